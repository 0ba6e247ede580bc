"""The claims of the papers, each put to the test: one module for each subject, which exports ``CLAIMS``."""

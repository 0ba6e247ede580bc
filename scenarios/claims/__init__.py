"""Testable claims of the papers, a module for each subject: see `scenarios.harness.claims.claim`."""

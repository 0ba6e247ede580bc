"""Recorded logs from anywhere, read into the rows that estimators take.

One module per format; each has ``read(path, ...) -> RecordedLog``.  `read` picks the module by the file.
"""

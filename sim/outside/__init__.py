"""Contact with the outside world: user code, untrusted files and text, signals and processes.

`blame` turns exceptions of user code into one line, `entry_points` finds what installed packages provide, `files` and
`sandbox` read untrusted files, `drafts` writes files atomically, `signals` and `processes` handle interruption and
child processes, `wording` and `numbers` make text safe to print and to parse.
"""

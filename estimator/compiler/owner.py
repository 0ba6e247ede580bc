"""Names of temporary files that identify the process, and whether that process is still running.

A process that is killed leaves its temporary files behind.  The next one removes those of processes that have ended.
Process numbers are reused: the mark therefore also contains the start time of the process and the machine.
"""

import hashlib
import os
import re
import socket
import time
from functools import cache
from pathlib import Path

FOREIGN_S = 86_400.0  # a file of another machine counts as left behind after a day without change
_MARK = re.compile(r"(?<![^.])(\d+)-(\d+)-([0-9a-f]{8})-([0-9a-f]{8})\.tmp(?![^.])")


def mark() -> str:
    """The mark of this process, for use in a name between two dots: ``.report.<mark>.json``.

    It ends in ``.tmp``.  One process has one mark: two files of one name at a time need a number as well.
    """
    pid = os.getpid()
    return f"{pid}-{_began(pid)}-{_host()}-{_boot()}.tmp"


def is_temporary(name: str) -> bool:
    """Whether a file of this name has the mark of a process."""
    return name.startswith(".") and _MARK.search(name) is not None


def is_left_behind(path: Path) -> bool:
    """Whether the file or folder at `path` has the mark of a process that has ended."""
    found = _MARK.search(path.name)
    if not path.name.startswith(".") or found is None:
        return False
    pid, began, host, boot = found.groups()
    if host != _host():
        try:
            return time.time() - path.lstat().st_mtime > FOREIGN_S
        except OSError:
            return False  # removed meanwhile
    return boot != _boot() or not _lives(int(pid), began)


def _lives(pid: int, began: str) -> bool:
    """Whether process `pid` is running and started at `began`."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # another user's process, or a system that does not say
    now = _began(pid)
    return "0" in (began, now) or began == now


def _began(pid: int) -> str:
    """Start time of the process in ticks since boot; 0 if it has ended or the system does not say."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return "0"
    state, *fields = stat.rpartition(")")[2].split()
    return "1" if state in "ZX" else fields[18]  # a zombie no longer writes


@cache
def _host() -> str:
    """The machine or container in 8 hexadecimal digits: process numbers are unique within it."""
    try:
        numbers = os.readlink("/proc/self/ns/pid")
    except OSError:
        numbers = ""
    return _short(f"{socket.gethostname()} {numbers}")


@cache
def _boot() -> str:
    """The present boot of the machine, in 8 hexadecimal digits."""
    try:
        return _short(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
    except OSError:
        return _short("")


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]

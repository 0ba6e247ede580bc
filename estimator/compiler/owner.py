"""Who made a temporary file: a mark of this process for its name, and whether the process of a mark still lives.

A process that is killed leaves its temporary files behind.  The next one removes those of the dead, and leaves those
of the living alone.  A process number alone does not tell them apart, it is given again: the mark also carries when
the process began, and on which machine.
"""

import hashlib
import os
import re
import socket
import time
from functools import cache
from pathlib import Path

FOREIGN_S = 86_400.0  # what another machine left is taken for dead when it has not changed for a day
_MARK = re.compile(r"(?<![^.])(\d+)-(\d+)-([0-9a-f]{8})-([0-9a-f]{8})\.tmp(?![^.])")


def mark() -> str:
    """The mark of this process, to be a part of a name between two dots: ``.report.<mark>.json``.

    It ends in ``.tmp``.  Same process, same mark: what is made twice at a time needs a number of its own beside it.
    """
    pid = os.getpid()
    return f"{pid}-{_began(pid)}-{_host()}-{_boot()}.tmp"


def is_temporary(name: str) -> bool:
    """Whether a file of this name carries the mark of some process."""
    return name.startswith(".") and _MARK.search(name) is not None


def is_left_behind(path: Path) -> bool:
    """Whether the file or folder at `path` carries the mark of a process that is gone."""
    found = _MARK.search(path.name)
    if not path.name.startswith(".") or found is None:
        return False
    pid, began, host, boot = found.groups()
    if host != _host():
        try:
            return time.time() - path.lstat().st_mtime > FOREIGN_S
        except OSError:
            return False  # it has gone by now
    return boot != _boot() or not _lives(int(pid), began)


def _lives(pid: int, began: str) -> bool:
    """Whether process `pid` runs, and is the one that `began` then."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # somebody else's, or a system that does not tell
    now = _began(pid)
    return "0" in (began, now) or began == now


def _began(pid: int) -> str:
    """When the process began, in ticks since the machine did; 0 where the system does not tell, or it is dead."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return "0"
    state, *fields = stat.rpartition(")")[2].split()
    return "1" if state in "ZX" else fields[18]  # a zombie writes no more


@cache
def _host() -> str:
    """The machine, or the container, in 8 hexadecimal digits: where process numbers mean the same."""
    try:
        numbers = os.readlink("/proc/self/ns/pid")
    except OSError:
        numbers = ""
    return _short(f"{socket.gethostname()} {numbers}")


@cache
def _boot() -> str:
    """The time since the machine was started, in 8 hexadecimal digits."""
    try:
        return _short(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
    except OSError:
        return _short("")


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]

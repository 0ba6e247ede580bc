"""Child processes that do not outlive the process that started them."""

import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1  # prctl(2)
_LOOK_S = 0.5


def die_with_parent() -> bool:
    """Have the system kill this process when its parent ends in any way (prctl(2)); False if unsupported.

    Survives exec, so that it can be used as ``preexec_fn``.
    """
    if sys.platform != "linux":
        return False
    return ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) == 0


def end_with_parent(parent: int) -> None:
    """End this process when its parent, with the id `parent`, ends; at once if it has ended already.

    By `die_with_parent`, or if unsupported by a thread that checks twice a second.
    """
    by_the_system = die_with_parent()
    if os.getppid() != parent:
        os._exit(1)
    if by_the_system:
        return

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()

"""The Rerun viewer as a separate process, bound to the loopback address."""

import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from sim.outside.processes import die_with_parent
from sim.recording import RecordingError


@dataclass(frozen=True, slots=True)
class Viewer:
    """A viewer process that was started.

    process : of the viewer, which outlives this one     url : its gRPC server, for `LiveView`
    address : to be opened in a browser; None if a window opens
    """

    process: subprocess.Popen[bytes]
    url: str
    address: str | None


def open_viewer(path: str | Path | None = None, *, web: bool = False) -> Viewer:
    """Start the Rerun viewer on the recording at `path`, or empty for a live flight; on the loopback address only.

    web : serve it to a browser instead of opening a window, needed without a display

    Raises
    ------
    RecordingError    no such file, no display, or the viewer does not start
    """
    if path is not None and not Path(path).is_file():
        raise RecordingError(f"no Rerun recording at {path}: there is no such file")
    if not web and not _has_display():
        raise RecordingError("no display to open a window on: add --web to serve the recording to a browser")
    grpc_port, web_port = free_port(), free_port()
    url = f"rerun+http://127.0.0.1:{grpc_port}/proxy"
    command = [str(executable()), "--bind", "127.0.0.1", "--port", str(grpc_port)]
    command += ["--serve-web", "--web-viewer-port", str(web_port)] if web else ["--expect-data-soon"]
    command += [] if path is None else [str(path)]
    process = subprocess.Popen(
        command,
        env={**os.environ, "RERUN_ANALYTICS": "0"},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=die_with_parent if web else None,  # a window may stay open, a server must end
    )  # fmt: skip
    for port in (grpc_port, web_port) if web else (grpc_port,):
        await_port(process, port)
    address = f"http://127.0.0.1:{web_port}/?url={url.replace('+', '%2B')}" if web else None
    return Viewer(process, url, address)


def executable() -> Path:
    """The Rerun program of the package; ``python -m rerun`` would leave it running when terminated."""
    spec = find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    candidates = (folder / "Rerun.app" / "Contents" / "MacOS" / "Rerun", folder / "rerun.exe", folder / "rerun")
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        raise RecordingError("the Rerun viewer is not installed: pip install rerun-sdk")
    return found


def _has_display() -> bool:
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def free_port() -> int:
    """A free port of the loopback address."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def await_port(process: subprocess.Popen[bytes], port: int, within_s: float = 20.0) -> None:
    """Wait until `process` listens on `port` of the loopback address; RecordingError if it does not."""
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        if process.poll() is not None:
            raise RecordingError(f"the Rerun viewer did not start: it ended with code {process.returncode}")
        with socket.socket() as s:
            s.settimeout(0.5)
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    process.terminate()
    raise RecordingError(f"the Rerun viewer did not start: nothing listens on 127.0.0.1:{port} after {within_s:g} s")

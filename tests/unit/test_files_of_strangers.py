"""What is opened, how far it may grow, and parsers that die: each ends in one line."""

import gzip
import os
import signal

import pytest

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError
from sim.outside import files, sandbox


@pytest.mark.parametrize("name", ["log.csv", "log.mat", "log.bin", "log.ulg", "log.parquet", "x_in.csv"])
def test_pipe_instead_of_a_log_is_refused_without_being_opened(tmp_path, name):
    """Opening it would wait for somebody to write."""
    os.mkfifo(tmp_path / name)
    with pytest.raises(LogError, match=rf"{name}: a pipe, not a log"):
        logs.read(tmp_path / name)


def test_packed_file_that_grows_without_end_is_refused_with_its_size(tmp_path, monkeypatch):
    """A hundred times its size is the most, or what any log may have."""
    monkeypatch.setattr(files, "FREELY", 1 << 20)
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(b"0,0,0\n" * 1_000_000))
    with pytest.raises(LogError, match=r"log\.csv\.gz: .* kB compressed, more than 1 MB decompressed"):
        logs.read(tmp_path / "log.csv.gz")


def test_packed_files_behind_each_other_are_one_text(tmp_path):
    packed = gzip.compress(b"ab") + gzip.compress(b"cd") + b"\0\0"
    assert files.unpacked(tmp_path, packed) == b"abcd"


def test_reader_that_dies_is_told_and_the_next_call_works(tmp_path, monkeypatch):
    """The child aborts amid a call, then another one is asked."""
    (tmp_path / "x").write_bytes(b"content")
    (tmp_path / "dying_reader.py").write_text("import os\ndef read(path):\n    os.abort()\n")
    monkeypatch.syspath_prepend(tmp_path)
    sandbox._end()  # the next one knows that folder
    with pytest.raises(sandbox.Crashed):
        sandbox.call("dying_reader:read", tmp_path / "x")
    assert sandbox.call("os.path:getsize", tmp_path / "x") == 7


def test_child_killed_while_idle_is_replaced(tmp_path):
    (tmp_path / "x").write_bytes(b"content")
    assert sandbox.call("os.path:getsize", tmp_path / "x") == 7
    child = sandbox._current().process
    child.send_signal(signal.SIGKILL)
    child.wait()
    assert sandbox.call("os.path:getsize", tmp_path / "x") == 7

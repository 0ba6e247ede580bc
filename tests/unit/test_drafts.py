"""What has its real name is complete; what the killed have left goes, what the living write stays."""

import errno
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from estimator.compiler import owner
from sim.outside.drafts import hidden, new_folder, probe, sweep


@pytest.fixture(scope="module")
def dead():
    """The mark of a process that has ended."""
    code = "from estimator.compiler import owner; print(owner.mark())"
    root = Path(owner.__file__).parents[2]
    return subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True).stdout[
        :-1
    ]


def changed(mark, **parts):
    """`mark` with some of its parts replaced."""
    names = ("pid", "began", "host", "boot")
    values = dict(zip(names, mark.removesuffix(".tmp").split("-"), strict=True)) | parts
    return "-".join(values[name] for name in names) + ".tmp"


def test_new_folder_appears_with_the_folders_above_it_when_it_is_complete(tmp_path):
    """Until the end of the block nothing has its real name, not even an empty folder above it."""
    into = tmp_path / "a" / "b"
    with new_folder(into, "flight") as draft:
        (draft.path / "x").write_text("1")
        assert not (tmp_path / "a").exists()
        assert [path.name.startswith(".") for path in tmp_path.iterdir()] == [True]
    assert draft.place == into / "flight"
    assert (draft.place / "x").read_text() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_new_folder_taken_name_gets_a_number_and_nothing_is_written_over(tmp_path):
    """A folder, an empty folder, a file and a link to nothing keep their names."""
    (tmp_path / "f").mkdir()
    (tmp_path / "f-2").write_text("mine")
    (tmp_path / "f-3").symlink_to("nothing")
    with new_folder(tmp_path, "f") as draft:
        (draft.path / "x").touch()
    assert draft.place == tmp_path / "f-4"
    assert list((tmp_path / "f").iterdir()) == []


def test_new_folder_exception_leaves_nothing(tmp_path):
    """Whatever ends the block, Ctrl-C too."""

    def interrupted():
        with new_folder(tmp_path / "a", "f") as draft:
            (draft.path / "x").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("a/../../b", "a_.._.._b"),
        (".hidden", "_hidden"),
        ("..", "_."),
        ("", "_"),
        ("a\nb\x00", "a_b_"),
        ("ä" * 300, "ä" * 90),
    ],
)
def test_new_folder_name_that_no_folder_can_have_is_made_fit(tmp_path, name, place):
    """A scenario or a log may be called anything."""
    with new_folder(tmp_path, name) as draft:
        pass
    assert draft.place == tmp_path / place
    assert draft.place.is_dir()


def test_new_folder_many_at_once_get_names_of_their_own(tmp_path):
    """Threads that write into a folder that is not there yet take nothing from one another."""
    places = []

    def write(k):
        with new_folder(tmp_path / "a" / "b", "f") as draft:
            (draft.path / "k").write_text(str(k))
        places.append((draft.place, k))

    threads = [threading.Thread(target=write, args=(k,)) for k in range(24)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(dict(places)) == 24
    assert all((place / "k").read_text() == str(k) for place, k in places)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert len(list((tmp_path / "a" / "b").iterdir())) == 24


def test_new_folder_full_disk_passes_on_and_leaves_nothing(tmp_path, monkeypatch):
    """The system's refusal to rename is not taken for a name that is taken."""

    def refuse(self, target):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "rename", refuse)
    with pytest.raises(OSError, match="No space"), new_folder(tmp_path / "a", "f"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_sweep_removes_what_the_dead_have_left_and_nothing_else(tmp_path, dead):
    """Files and folders of a dead process go; those of this one, and whatever looks similar, stay."""
    gone = [tmp_path / f".report.1.{dead}.json", tmp_path / f".flight.2.{dead}", tmp_path / f".x.3.{dead}.tar"]
    stays = [hidden(tmp_path / "report.json"), tmp_path / f"report.{dead}.json", tmp_path / ".report.1.tmp.json"]
    stays += [tmp_path / f".report.x{dead}.json", tmp_path / f".report.{dead}x", tmp_path / "deep" / f".a.1.{dead}"]
    stays[-1].parent.mkdir()
    for path in (gone[0], gone[2], *stays):
        path.touch()
    gone[1].mkdir()
    (gone[1] / "flight.parquet").touch()
    sweep(tmp_path, tmp_path / "nowhere")
    assert not any(path.exists() for path in gone)
    assert all(path.exists() for path in stays)


@pytest.mark.parametrize(
    ("parts", "age_s", "goes"),
    [
        ({}, 0.0, False),
        ({"began": "12345"}, 0.0, True),  # the number was given to another process
        ({"boot": "00000000"}, 0.0, True),  # the machine was started anew
        ({"host": "00000000"}, 3600.0, False),  # another machine, which may be writing
        ({"host": "00000000"}, 2 * owner.FOREIGN_S, True),
        ({"pid": "99999999999999999999"}, 0.0, True),  # a number that no process has
    ],
)
def test_sweep_tells_the_living_from_the_dead(tmp_path, parts, age_s, goes):
    """By process, by when it began, by the start of the machine; of other machines by age."""
    path = tmp_path / f".report.1.{changed(owner.mark(), **parts)}.json"
    path.touch()
    os.utime(path, (time.time() - age_s,) * 2)
    sweep(tmp_path)
    assert path.exists() is not goes


def test_sweep_zombie_is_dead(tmp_path):
    """A process that has ended and that nobody has asked for writes no more."""
    if not Path("/proc/self/stat").exists():
        pytest.skip("this system does not tell when a process began")
    with subprocess.Popen([sys.executable, "-c", ""], stdout=subprocess.PIPE) as child:
        stat = Path(f"/proc/{child.pid}/stat")
        began = stat.read_text().rpartition(")")[2].split()[19]
        path = tmp_path / f".report.1.{changed(owner.mark(), pid=str(child.pid), began=began)}.json"
        path.touch()
        while stat.read_text().rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)
        sweep(tmp_path)
    assert not path.exists()


def test_probe_leaves_no_trace_and_sweeps(tmp_path, dead):
    """Nothing is made, not for a moment under a real name; what the dead have left goes."""
    (tmp_path / f".f.1.{dead}").mkdir()
    probe(tmp_path / "not" / "yet")
    probe(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_probe_refuses_what_cannot_be_written_to(tmp_path):
    """A file, a folder below a file, a link to nothing, a name that is too long."""
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("nothing")
    for path in ("file", "file/below", "link", "link/below"):
        with pytest.raises(OSError, match=r"Not a directory|does not exist"):
            probe(tmp_path / path)
    with pytest.raises(OSError, match="too long"):
        probe(tmp_path / ("x" * 300))


def test_hidden_is_another_name_each_time_and_no_longer_than_names_may_be(tmp_path):
    """It keeps the suffix, by which some writers choose their format."""
    path = tmp_path / f"{'x' * 240}.json"
    names = {hidden(path).name for _ in range(10)}
    assert len(names) == 10
    assert all(name.endswith(".json") and len(name) < 200 for name in names)
    hidden(path).touch()


def test_new_folder_is_not_found_by_who_looks_for_recordings_before_it_is_complete(tmp_path):
    """``view`` takes the newest ``*/flight.parquet``, and must not take one that is being written."""
    with new_folder(tmp_path, "f") as draft:
        (draft.path / "flight.parquet").touch()
        assert list(tmp_path.glob("*/flight.parquet")) == []
    assert list(tmp_path.glob("*/flight.parquet")) == [tmp_path / "f" / "flight.parquet"]

"""Files and folders written under a hidden name until they are complete.

Anything with its final name is complete.  A process killed while writing leaves a hidden entry marked with its id
(`estimator.compiler.owner`); the next writer into the same folder removes it, but not those of running processes.
"""

import errno
import itertools
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from estimator.compiler import owner

_LONGEST = 40  # characters of the final name in a hidden one; file systems allow 255 in all
_LONGEST_NAME = 180  # bytes of the name of a folder, with room for a number
_count = itertools.count(1)


def hidden(path: Path) -> Path:
    """A unique hidden name beside `path`, with its suffix, to be renamed to it."""
    return path.with_name(f".{path.stem[:_LONGEST]}.{next(_count)}.{owner.mark()}{path.suffix[:_LONGEST]}")


def sweep(*folders: Path) -> None:
    """Remove incomplete entries of killed processes from the folders, not from subfolders."""
    for folder in folders:
        with suppress(OSError):  # what cannot be removed does no harm
            for entry in os.scandir(folder):
                if owner.is_temporary(entry.name) and owner.is_left_behind(Path(entry.path)):
                    if entry.is_dir(follow_symlinks=False):
                        shutil.rmtree(entry.path, ignore_errors=True)
                    else:
                        Path(entry.path).unlink(missing_ok=True)


def probe(folder: Path) -> None:
    """Check that `folder` can be created, or written to if it exists; leaves no trace.

    Raises
    ------
    OSError      the reason
    """
    here = _existing(folder)
    for missing in (folder, *folder.parents):
        if missing == here or missing.exists():
            break
        if os.path.lexists(missing):
            raise OSError(errno.ENOENT, f"{missing.name} is a link to a place that does not exist")
    sweep(here)
    file = hidden(here / "test")
    try:
        file.write_bytes(b"x")
    finally:
        with suppress(OSError):
            file.unlink()


@dataclass
class Draft:
    """A folder being written.

    path : until the end of the block      place : afterwards
    """

    path: Path
    place: Path

    def named(self, text: str) -> str:
        """`text` with the temporary path replaced by the final one."""
        return text.replace(str(self.path), str(self.place))


@contextmanager
def new_folder(into: Path, name: str) -> Iterator[Draft]:
    """Give a new folder to fill; at the end of the block it appears complete in `into` as `name` or ``name-2``, ...

    No existing folder is overwritten, even with concurrent writers.  On any exception nothing is left.

    Raises
    ------
    OSError      the folder cannot be written
    """
    name = _fit(name)
    here = _existing(into)
    if here != into:
        into = Path(os.path.normpath(into))  # resolve ``..`` in folders that do not exist yet
    sweep(here, here.parent)
    shell = hidden(here / name)
    draft = Draft(shell / name, into / name)
    try:
        draft.path.mkdir(parents=True)
        yield draft
        draft.place = _publish(draft.path, into, name, shell)
    finally:
        shutil.rmtree(shell, ignore_errors=True)


def _fit(name: str) -> str:
    """`name` as a valid folder name: not hidden, without separators or unprintable characters, not too long."""
    fit = "".join(c if c.isprintable() and c not in "/\\" else "_" for c in name)
    fit = os.fsencode(fit)[:_LONGEST_NAME].decode(errors="ignore")
    return f"_{fit[1:]}" if fit.startswith(".") or not fit else fit


def _existing(folder: Path) -> Path:
    """`folder`, or its nearest existing parent."""
    return next((p for p in (folder, *folder.absolute().parents) if p.exists()), folder)


def _publish(source: Path, into: Path, name: str, shell: Path) -> Path:
    """Rename `source` to the first free name in `into`."""
    number = 1
    while True:
        place = into / (name if number == 1 else f"{name}-{number}")
        if os.path.lexists(place):
            number += 1
            continue
        try:
            _move(source, place, shell)
        except OSError as error:
            was_faster = error.errno in (errno.EEXIST, errno.ENOTEMPTY) and into.is_dir()
            if not was_faster:
                raise
        else:
            return place


def _move(source: Path, place: Path, shell: Path) -> None:
    """Rename the folder `source` to `place`, creating missing parents in the same atomic step."""
    top = place
    while not os.path.lexists(top.parent):
        top = top.parent
    if top == place:
        source.rename(place)
        return
    tree = shell / "new"
    inside = tree / place.relative_to(top)
    inside.parent.mkdir(parents=True, exist_ok=True)
    source.rename(inside)
    try:
        tree.rename(top)
    except OSError:
        inside.rename(source)
        raise

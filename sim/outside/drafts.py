"""Files and folders that are being written: under a hidden name, until they are complete.

What has its real name is complete.  Whoever is killed while writing leaves something hidden behind, which carries the
mark of the process (`estimator.compiler.owner`); whoever writes into the same folder next removes it, and leaves alone
what a living process is writing there.
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

_LONGEST = 40  # characters of the real name in a hidden one; a file system takes 255 in all
_LONGEST_NAME = 180  # bytes of the name of a folder, with room for a number
_count = itertools.count(1)


def hidden(path: Path) -> Path:
    """A name beside `path`, with its suffix, for what will be renamed to it; never the same twice."""
    return path.with_name(f".{path.stem[:_LONGEST]}.{next(_count)}.{owner.mark()}{path.suffix[:_LONGEST]}")


def sweep(*folders: Path) -> None:
    """Remove what killed processes have left half written in the folders, not in folders below them."""
    for folder in folders:
        with suppress(OSError):  # what cannot be removed is not in the way
            for entry in os.scandir(folder):
                if owner.is_temporary(entry.name) and owner.is_left_behind(Path(entry.path)):
                    if entry.is_dir(follow_symlinks=False):
                        shutil.rmtree(entry.path, ignore_errors=True)
                    else:
                        Path(entry.path).unlink(missing_ok=True)


def probe(folder: Path) -> None:
    """Try whether a new folder could be made at `folder`, or be filled where it exists; nothing is left.

    Raises
    ------
    OSError      why not
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
    """A folder that is being filled.

    path : where, until the end of the block      place : where it is afterwards
    """

    path: Path
    place: Path

    def named(self, text: str) -> str:
        """`text` about what is being written, with the names that it will have."""
        return text.replace(str(self.path), str(self.place))


@contextmanager
def new_folder(into: Path, name: str) -> Iterator[Draft]:
    """Give a new folder to fill; at the end of the block it appears in `into`, complete, as `name` or ``name-2``, ...

    No folder is ever written over, whoever else is writing there.  On any exception nothing is left.

    Raises
    ------
    OSError      where the system refuses
    """
    name = _fit(name)
    here = _existing(into)
    if here != into:
        into = Path(os.path.normpath(into))  # folders that are not there yet: ``..`` means nothing in them
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
    """`name` as the name of one folder: not hidden, no separators, nothing unprintable, not too long."""
    fit = "".join(c if c.isprintable() and c not in "/\\" else "_" for c in name)
    fit = os.fsencode(fit)[:_LONGEST_NAME].decode(errors="ignore")
    return f"_{fit[1:]}" if fit.startswith(".") or not fit else fit


def _existing(folder: Path) -> Path:
    """`folder`, or the nearest one above it that exists."""
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
    """Rename the folder `source` to `place`, with the folders above it that are missing, all at once."""
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

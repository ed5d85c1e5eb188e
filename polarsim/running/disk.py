"""What the disk must give before a run starts: room, permission, no leftovers of killed jobs, no stamps of tomorrow."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from polarsim.config import Config
from polarsim.errors import PolarsimError
from polarsim.grid import selected_grid

_LEFTOVER = re.compile(r"\..+\.(\d+)(\.\w+)?")  # as `polarsim.formats.files.writing` names what is not yet whole
_LATER_S = 60.0  # clocks of file servers are off by less
NEARLY_FULL_BYTES = 20_000_000  # less than some files of a run have
_LEAST_BYTES = 500_000_000  # of a part of a run: nobody knows what its targets take
# Measured on `make demo` (4 terrains, 432 photos, 2 models: 1.4 GB of data, 1.2 GB of results), rounded up; meshes at
# their default cells have four times the demo's triangles.
_DATA_OF_TERRAIN, _DATA_OF_PHOTO = 200_000_000, 1_500_000
_RESULTS_OF_TERRAIN, _RESULTS_OF_PHOTO, _TWIN = 350_000_000, 250_000, 900_000


def expected_bytes(config: Config) -> int:
    """About what a whole run takes with the analog's data, bytes; drives and novel views are not counted."""
    photos = sum(len(selected_grid(terrain, config.positions, config.grid)) for terrain in config.terrains)
    found = len(config.terrains) * _RESULTS_OF_TERRAIN
    found += photos * (_RESULTS_OF_PHOTO + _TWIN * len(config.render.models))
    if config.data_source.is_generated:
        found += len(config.terrains) * _DATA_OF_TERRAIN + photos * _DATA_OF_PHOTO
    return found


def needed_bytes(config: Config, whole: bool, places: Sequence[Path]) -> int:
    """What must be free: the estimate less what is there already, of a part of a run a lump."""
    if not whole:
        return _LEAST_BYTES
    found = (entry.stat(follow_symlinks=False) for place in places for entry in _entries(place))
    there = {(one.st_dev, one.st_ino): one.st_size for one in found}  # a file of several names once
    return max(_LEAST_BYTES, expected_bytes(config) - sum(there.values()))


def free_bytes(place: Path) -> int:
    return shutil.disk_usage(_existing(place)).free


def refuse_full(place: Path, needed: int) -> None:
    """End where fewer bytes are free than a run needs."""
    free = free_bytes(place)
    if free < needed:
        wanted = f"{free / 1e9:.2f} GB free, about {needed / 1e9:.2f} GB are needed"
        raise PolarsimError(f"{wanted}; make room, or say how much is enough with --min-free", path=place)


def refuse_unwritable(place: Path) -> None:
    """End where nothing can be written; tried, since permissions do not tell of read-only disks and quotas."""
    folder = _existing(place)
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"0")
    except OSError as error:
        raise PolarsimError(f"cannot be written, {error.strerror}", path=folder) from error


def remove_leftovers(places: Sequence[Path]) -> int:
    """Remove what killed jobs were writing; how many files and folders that were.

    Nothing else may be at work there but commands of this machine that are alive, whose files stay.
    """
    found = [
        Path(entry.path)
        for place in places
        for entry in _entries(place)
        if (name := _LEFTOVER.fullmatch(entry.name)) and not Path(f"/proc/{name[1]}").exists()
    ]
    for path in found:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink(missing_ok=True)
    return len(found)


def pull_back_stamps(places: Sequence[Path], folder: Path) -> int:
    """Give what is stamped in the future the present time, in its own order; how many files that were.

    An input from tomorrow is newer than all that is made of it, so that every call would make everything anew.

    Raises
    ------
    PolarsimError
        The file lies outside `folder`: it is not ours to touch.
    """
    now = time.time_ns()
    later = [
        (entry.stat(follow_symlinks=False).st_mtime_ns, entry.path)
        for place in places
        for entry in _entries(place)
        if entry.stat(follow_symlinks=False).st_mtime_ns > now + _LATER_S * 1e9
    ]
    for _, path in later:
        if not Path(path).resolve().is_relative_to(folder):
            raise PolarsimError("its time stamp lies in the future, all would be made anew: touch it", path=path)
    for number, (_, path) in enumerate(sorted(later)):
        stamp = now - 1000 * (len(later) - number)
        os.utime(path, ns=(stamp, stamp), follow_symlinks=False)
    return len(later)


def _existing(place: Path) -> Path:
    """The folder itself, or the nearest one above it that is there."""
    return next(path for path in (place.absolute(), *place.absolute().parents) if path.is_dir())


def _entries(place: Path) -> Iterator[os.DirEntry[str]]:
    """All files and folders below a folder, inner ones first; links are not followed."""
    with suppress(FileNotFoundError, NotADirectoryError), os.scandir(place) as found:
        for entry in found:
            if entry.is_dir(follow_symlinks=False):
                yield from _entries(Path(entry.path))
            yield entry

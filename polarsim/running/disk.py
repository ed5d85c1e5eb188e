"""Free space and permissions before a run starts, and unfinished files of killed jobs."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import psutil

from polarsim.config import Config
from polarsim.errors import PolarsimError
from polarsim.grid import selected_grid

_LEFTOVER = re.compile(r"\..+\.(\d+)(\.\w+)?")  # names of incomplete files, see `polarsim.formats.files.writing`
NEARLY_FULL_BYTES = 20_000_000  # smaller than some files of a run
_MIN_BYTES = 500_000_000  # for a part of a run, whose size is not estimated
# Measured on `config/overlays/large.yaml` (4 terrains, 432 photos, 2 models: 1.4 GB of data, 1.2 GB of results),
# rounded up; meshes at their default cells have four times the triangles.
_DATA_OF_TERRAIN, _DATA_OF_PHOTO = 200_000_000, 1_500_000
_RESULTS_OF_TERRAIN, _RESULTS_OF_PHOTO, _TWIN = 350_000_000, 250_000, 900_000


def expected_bytes(config: Config) -> int:
    """Return the approximate size of a complete run with generated data, bytes, without drives and novel views."""
    photos = sum(len(selected_grid(config.site, terrain, config.positions, config.grid)) for terrain in config.terrains)
    found = len(config.terrains) * _RESULTS_OF_TERRAIN
    found += photos * (_RESULTS_OF_PHOTO + _TWIN * len(config.render.models))
    if config.data_source.is_generated:
        found += len(config.terrains) * _DATA_OF_TERRAIN + photos * _DATA_OF_PHOTO
    return found


def needed_bytes(config: Config, complete: bool, places: Sequence[Path]) -> int:
    """Return the required free space, bytes: estimate minus existing files; for a part of a run a constant."""
    if not complete:
        return _MIN_BYTES
    found = (path.lstat() for place in places for path in place.rglob("*"))
    existing = {(entry.st_dev, entry.st_ino): entry.st_size for entry in found}  # hard links are counted once
    return max(_MIN_BYTES, expected_bytes(config) - sum(existing.values()))


def free_bytes(place: Path) -> int:
    return shutil.disk_usage(_existing(place)).free


def refuse_full(place: Path, needed: int) -> None:
    """Raise a PolarsimError if fewer bytes are free than a run needs."""
    free = free_bytes(place)
    if free < needed:
        wanted = f"{free / 1e9:.2f} GB free, about {needed / 1e9:.2f} GB required"
        raise PolarsimError(f"{wanted}; free disk space, or set --min-free", path=place)


def refuse_unwritable(place: Path) -> None:
    """Raise a PolarsimError if a trial file cannot be written: permissions do not show read-only disks and quotas."""
    folder = _existing(place)
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"0")
    except OSError as error:
        raise PolarsimError(f"cannot be written, {error.strerror}", path=folder) from error


def remove_leftovers(place: Path) -> int:
    """Remove the unfinished files of killed jobs; return the number of files and folders.

    No job may be active in the folder. Files of other running commands are not removed.
    """
    found = [
        path
        for path in place.rglob(".*")
        if (name := _LEFTOVER.fullmatch(path.name)) and not psutil.pid_exists(int(name[1]))
    ]
    for path in found:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink(missing_ok=True)
    return len(found)


def _existing(place: Path) -> Path:
    """Return the folder, or its nearest existing parent."""
    return next(path for path in (place.absolute(), *place.absolute().parents) if path.is_dir())

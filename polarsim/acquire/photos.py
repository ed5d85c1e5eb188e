"""The index of a terrain's photos: what each file holds, and which photos of the grid are not there."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.errors import FormatError, about
from polarsim.formats import png
from polarsim.formats.schemas import PHOTOS
from polarsim.formats.tables import key_columns
from polarsim.photo import HEIGHT, WIDTH, PhotoKey
from polarsim.progress import track

PHOTO_BITS = 16  # of the files; their values have 12

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Gaps:
    """What is missing of the photo grid."""

    missing: tuple[PhotoKey, ...]
    unpaired: tuple[PhotoKey, ...]  # photos whose other camera is not there


def describe_photo(path: Path) -> dict[str, object]:
    """Width and height in pixels, bits, SHA-256 and path of a raw photo.

    Raises
    ------
    FormatError
        The file cannot be read or is damaged, or is no grey 16-bit PNG of NASA's size.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FormatError(f"no readable photo, {error.strerror or error}", path=path) from error
    with about(path):
        header = png.parse_header(content)
        if (header.width, header.height) != (WIDTH, HEIGHT):
            raise FormatError(f"{header.width} x {header.height} pixels, expected {WIDTH} x {HEIGHT}")
        if header.bits != PHOTO_BITS or header.channels != 1:
            raise FormatError(f"{header.channels} channels of {header.bits} bits, a photo has 1 of {PHOTO_BITS}")
    return {
        "width": header.width,
        "height": header.height,
        "bits": header.bits,
        "sha256": hashlib.sha256(content).hexdigest(),
        "path": path.as_posix(),
    }


def index_photos(files: Sequence[tuple[PhotoKey, Path]]) -> pd.DataFrame:
    """A row a photo; see `describe_photo` for what is refused."""
    return photo_table([{**key_columns(key), **describe_photo(path)} for key, path in track(files, "reading photos")])


def photo_table(rows: Sequence[Mapping[Any, Any]]) -> pd.DataFrame:
    """Rows of `PHOTOS`, typed and in the order of keys; also when there are none."""
    table = pd.DataFrame(rows, columns=list(PHOTOS.columns)).astype(PHOTOS.dtypes)
    return table.sort_values("key", ignore_index=True)


def find_gaps(keys: Collection[PhotoKey], expected: Sequence[PhotoKey]) -> Gaps:
    """Expected photos that are not among `keys`, and photos without their other camera's."""
    there = set(keys)
    missing = [key for key in expected if key not in there]
    unpaired = [key for key in sorted(there) if other_camera(key) not in there]
    return Gaps(tuple(missing), tuple(unpaired))


def other_camera(key: PhotoKey) -> PhotoKey:
    """The same photo by the other camera of the rig."""
    return replace(key, camera="R" if key.camera == "L" else "L")


def log_gaps(gaps: Gaps, found: int, folder: Path) -> None:
    """One line where something is missing."""
    if not found:
        log.warning("%s: no photo", folder)
    elif gaps.missing or gaps.unpaired:
        example = f", such as {(*gaps.unpaired, *gaps.missing)[0]}"
        log.warning(
            "%s: %d photos found, %d of the grid missing, %d without the other camera's%s",
            folder, found, len(gaps.missing), len(gaps.unpaired), example,
        )  # fmt: skip

"""Photos in polarsim's photo format: those of other sites are converted once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.files import writing_folder
from polarsim.formats.readers import reader
from polarsim.photo import PhotoKey
from polarsim.photo_format import in_photo_format
from polarsim.progress import track
from polarsim.site import Site
from polarsim.site_parts import Images


@contextmanager
def photos_of_run(
    files: Sequence[tuple[PhotoKey, Path]], site: Site, folder: str | Path | None
) -> Iterator[dict[PhotoKey, Path]]:
    """Yield photos in polarsim's photo format: the files themselves, or converted files `KEY.png`.

    `folder` is required for sites with `Site.converts_photos` and replaced when the block ends without an error; inside
    the block, paths are those of a temporary folder.
    """
    if not site.converts_photos:
        yield dict(files)
        return
    assert folder is not None
    with writing_folder(folder) as temporary:
        paths = {key: temporary / f"{key}.png" for key, _ in files}
        for key, path in track(files, "converting photos"):
            png.write_png(paths[key], convert_photo(path, site.images))
        yield paths


@reader("photo")
def read_stored(path: Path, form: Images) -> np.ndarray:
    """Read a photo of a site with the values of the file: (h, w) or, in colour, (h, w, 3; RGB order).

    Raises
    ------
    FormatError
        The size or the bits differ from those of the site, or a value exceeds the white level.
    """
    pixels = png.read_png(path)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise FormatError(f"values of the type {pixels.dtype}, expected integers of {form.bits} bits")
    if pixels.dtype == np.uint8 and form.bits > 8:
        raise FormatError(f"8 bits, expected {form.bits} (images.bits of the site)")
    height, width = pixels.shape[:2]
    if (width, height) != form.size:
        raise FormatError(
            f"{width} x {height} pixels, expected {form.width} x {form.height} (images.width and images.height of the "
            "site)"
        )
    if (largest := int(pixels.max(initial=0))) > form.white_level:
        raise FormatError(
            f"value {largest}, expected at most {form.white_level} (images.bits and images.white of the site, "
            "in the low bits)"
        )
    return pixels


def convert_photo(path: Path, form: Images) -> np.ndarray:
    """Read a photo of a site and return it (h, w) uint16 in polarsim's photo format; see `read_stored` for errors."""
    return in_photo_format(read_stored(path, form), form)

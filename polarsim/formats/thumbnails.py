"""Small images as data URIs, for pages."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from polarsim.formats import png
from polarsim.tone import to_8bit

if TYPE_CHECKING:
    from PIL import Image

_QUALITY = 82  # of WebP; lines and digits remain sharp


def of_picture(path: Path, width: int) -> str:
    """Return an 8-bit image as a data URI (WebP) with a maximum width in pixels."""
    from PIL import Image

    with Image.open(path) as picture:
        return _data_uri(picture.convert("RGB"), width)


def of_photo(path: Path, width: int) -> str:
    """Return a 12-bit photo or twin, tone-mapped by brightness, as a data URI (WebP) with a maximum width in pixels."""
    from PIL import Image

    return _data_uri(Image.fromarray(np.ascontiguousarray(to_8bit(png.read_png(path)))), width)


def _data_uri(picture: Image.Image, width: int) -> str:
    from PIL import Image

    coded = io.BytesIO()
    picture.thumbnail((width, 4 * width), Image.Resampling.LANCZOS)
    picture.save(coded, "WEBP", quality=_QUALITY, method=4)
    return f"data:image/webp;base64,{base64.b64encode(coded.getvalue()).decode('ascii')}"

"""PNG pictures: 16-bit photos with 12-bit values, 8-bit maps. Written fast and the same bytes every time."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import writing
from polarsim.photo import HEIGHT, WHITE_LEVEL, WIDTH

os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(1 << 24))  # read by OpenCV at import: refuses PNG bombs


def read(path: str | Path) -> np.ndarray:
    """Pixels (h, w) or (h, w, 3; RGB order) as stored, uint8 or uint16.

    Raises
    ------
    FormatError
        The file is missing, cut, or no picture.
    """
    import cv2

    try:
        pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise FormatError(f"{path}: no readable picture, {error.err}") from error
    if pixels is None:
        raise FormatError(f"{path}: no readable picture")
    if pixels.ndim == 3:
        pixels = pixels[..., [2, 1, 0]]
    return np.asarray(pixels)


def read_photo(path: str | Path, size: tuple[int, int] = (WIDTH, HEIGHT)) -> np.ndarray:
    """A raw photo: (h, w) uint16 with 12-bit values.

    Raises
    ------
    FormatError
        Another size (width, height), bit depth or number of channels, or values beyond 12 bits.
    """
    pixels = read(path)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise FormatError(f"{path}: {pixels.dtype} with shape {pixels.shape}, a photo is one channel of 16 bits")
    if (pixels.shape[1], pixels.shape[0]) != size:
        raise FormatError(f"{path}: {pixels.shape[1]} x {pixels.shape[0]} pixels, expected {size[0]} x {size[1]}")
    if pixels.max(initial=0) > WHITE_LEVEL:
        raise FormatError(f"{path}: value {pixels.max()}, a photo has 12 bits (0 to {WHITE_LEVEL})")
    return pixels


def write(path: str | Path, pixels: np.ndarray) -> None:
    """Write (h, w) or (h, w, 3; RGB order) pixels, uint8 or uint16.

    Raises
    ------
    PolarsimError
        The file cannot be written.
    """
    import cv2

    if pixels.ndim == 3:
        pixels = pixels[..., ::-1]
    # No level is asked for: naming one switches OpenCV to adaptive filters, three times slower and larger.
    done, coded = cv2.imencode(".png", np.ascontiguousarray(pixels))
    assert done
    with writing(path) as temporary:
        temporary.write_bytes(coded.tobytes())

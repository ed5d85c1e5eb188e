"""PNG pictures: 16-bit photos with 12-bit values, 8-bit maps. Written fast and the same bytes every time."""

from __future__ import annotations

import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import write_bytes
from polarsim.formats.readers import reader
from polarsim.photo import HEIGHT, WHITE_LEVEL, WIDTH

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # of PNG's colour types
_FROM_LEFT = 1  # PNG's filter "Sub"
_LEVEL = 1  # of ISA-L's 0 to 3: higher ones gain nothing on photos

MOST_PIXELS = 1 << 24  # of a picture of any kind; a photo has 2.4 million
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))  # read by OpenCV at import: of other kinds too


@dataclass(frozen=True)
class Header:
    """What a PNG file states about itself: size in pixels, bits a channel, channels."""

    width: int
    height: int
    bits: int
    channels: int


def parse_header(content: bytes) -> Header:
    """Header of a whole PNG file, whose chunks are all there and bear their checksums; no pixel is decoded.

    Raises
    ------
    FormatError
        No PNG, or cut or damaged.
    """
    if not content.startswith(_SIGNATURE):
        raise FormatError("no PNG file")
    offset, kind, header = len(_SIGNATURE), b"", b""
    while kind != b"IEND":
        length, kind = struct.unpack(">I4s", content[offset : offset + 8].ljust(8, b"\0"))
        end = offset + 12 + length
        if end > len(content):
            raise FormatError(f"the PNG file is cut after {len(content)} bytes")
        if zlib.crc32(content[offset + 4 : end - 4]) != int.from_bytes(content[end - 4 : end], "big"):
            raise FormatError(f"a damaged PNG file, wrong checksum at byte {offset}")
        if offset == len(_SIGNATURE):
            header = content[offset + 8 : end - 4]
        offset = end
    if len(header) != 13 or header[9] not in _CHANNELS:
        raise FormatError("a PNG file without a header")
    width, height, bits, colour = struct.unpack(">IIBB", header[:10])
    return Header(width, height, bits, _CHANNELS[colour])


@reader("picture")
def read(path: str | Path) -> np.ndarray:
    """Pixels (h, w) or (h, w, 3; RGB order) as stored, uint8 or uint16.

    Raises
    ------
    FormatError
        The file is missing, cut, or no picture.
    """
    import cv2

    content = Path(path).read_bytes()
    if content.startswith(_SIGNATURE):
        header = parse_header(content)  # OpenCV reads cut and damaged files without a word
        if header.width * header.height > MOST_PIXELS:
            raise FormatError(f"{header.width} x {header.height} pixels, a picture has at most {MOST_PIXELS}")
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if content else None
    if pixels is None:
        raise FormatError("no readable picture")
    if pixels.ndim == 3:
        pixels = pixels[..., [2, 1, 0]]
    return np.asarray(pixels)


@reader("photo")
def read_photo(path: str | Path, size: tuple[int, int] = (WIDTH, HEIGHT)) -> np.ndarray:
    """A raw photo: (h, w) uint16 with 12-bit values.

    Raises
    ------
    FormatError
        Another size (width, height), bit depth or number of channels, or values beyond 12 bits.
    """
    pixels = read(path)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise FormatError(f"{pixels.dtype} with shape {pixels.shape}, a photo is one channel of 16 bits", path=path)
    if (pixels.shape[1], pixels.shape[0]) != size:
        raise FormatError(f"{pixels.shape[1]} x {pixels.shape[0]} pixels, expected {size[0]} x {size[1]}", path=path)
    if pixels.max(initial=0) > WHITE_LEVEL:
        raise FormatError(f"value {pixels.max()}, a photo has 12 bits (0 to {WHITE_LEVEL})", path=path)
    return pixels


def write(path: str | Path, pixels: np.ndarray) -> None:
    """Write (h, w) or (h, w, 3; RGB order) pixels, uint8 or uint16.

    Raises
    ------
    PolarsimError
        The file cannot be written.
    """
    write_bytes(path, encode(pixels))


def encode(pixels: np.ndarray) -> bytes:
    """A PNG file of (h, w) or (h, w, 3; RGB order) pixels, uint8 or uint16.

    Intel's deflate takes a fifth of OpenCV's time; every row is stored as differences to the pixel on its left.
    """
    from isal import isal_zlib

    assert pixels.dtype in (np.uint8, np.uint16)
    assert pixels.shape[2:] in ((), (3,))
    height, width = pixels.shape[:2]
    bits = 8 * pixels.itemsize
    step = pixels.itemsize * (3 if pixels.ndim == 3 else 1)  # bytes from a pixel to the next
    rows = np.ascontiguousarray(pixels, f">u{pixels.itemsize}").view(np.uint8).reshape(height, width * step)
    filtered = np.empty((height, 1 + width * step), np.uint8)
    filtered[:, 0] = _FROM_LEFT
    filtered[:, 1 : 1 + step] = rows[:, :step]
    np.subtract(rows[:, step:], rows[:, :-step], out=filtered[:, 1 + step :])
    header = struct.pack(">IIBBBBB", width, height, bits, 2 if pixels.ndim == 3 else 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", isal_zlib.compress(filtered, _LEVEL)), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(kind, content) for kind, content in parts)


def _chunk(kind: bytes, content: bytes) -> bytes:
    from isal import isal_zlib

    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", isal_zlib.crc32(kind + content))

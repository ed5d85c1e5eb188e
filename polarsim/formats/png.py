"""Images: PNG files of 16-bit photos with 12-bit values and of 8-bit maps, written fast and with reproducible bytes.

`read_png` and `size` also accept JPEG, TIFF, BMP, WebP and PGM files. Both apply the EXIF orientation, as viewers and
annotation tools do.
"""

from __future__ import annotations

import io
import os
import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import write_bytes
from polarsim.formats.readers import reader
from polarsim.photo import WHITE_LEVEL

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # number of channels by PNG colour type
_FILTER_SUB = 1
_LEVEL = 1  # of ISA-L's levels 0 to 3; higher levels save less than 2 % on photos
_FIRST = 16  # bytes, see `_deflate`
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # signatures of TIFF and BigTIFF
_MAX_BANDS = 4
_ORIENTATION = 0x0112  # EXIF tag
_TRANSPOSED = (5, 6, 7, 8)  # values of the tag that exchange width and height

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm")
MAX_PIXELS = 1 << 28  # 268 megapixels, more than any camera has; a photo has 2.4 megapixels
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))  # OpenCV reads both variables on import
os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # polarsim reports the error


@dataclass(frozen=True)
class Header:
    """Header of a PNG file: size in pixels as stored, bits per channel, channels, and EXIF orientation (1 to 8)."""

    width: int
    height: int
    bits: int
    channels: int
    orientation: int = 1


def parse_header(content: bytes) -> Header:
    """Return the header of a PNG file after a check that all chunks are complete; pixels are not decoded."""
    from isal import isal_zlib

    if not content.startswith(_SIGNATURE):
        raise FormatError("no PNG file")
    view = memoryview(content)  # without copies of the chunks
    offset, kind, header, exif = len(_SIGNATURE), b"", b"", b""
    while kind != b"IEND":
        length, kind = struct.unpack(">I4s", content[offset : offset + 8].ljust(8, b"\0"))
        end = offset + 12 + length
        if end > len(content):
            raise FormatError(f"the PNG file is truncated after {len(content)} bytes")
        if isal_zlib.crc32(view[offset + 4 : end - 4]) != int.from_bytes(content[end - 4 : end], "big"):
            raise FormatError(f"the PNG file is damaged, wrong checksum at byte {offset}")
        if offset == len(_SIGNATURE):
            header = content[offset + 8 : end - 4]
        if kind == b"eXIf":
            exif = content[offset + 8 : end - 4]
        offset = end
    if len(header) != 13 or header[9] not in _CHANNELS:
        raise FormatError("the PNG file has no header")
    width, height, bits, colour = struct.unpack(">IIBB", header[:10])
    return Header(width, height, bits, _CHANNELS[colour], _orientation(exif) if exif else 1)


def _orientation(exif: bytes) -> int:
    """Return the orientation in an EXIF block; 1 if the block is damaged, as viewers do."""
    from PIL import Image

    with suppress(Exception):
        tags = Image.Exif()
        tags.load(exif)
        return int(tags.get(_ORIENTATION, 1))
    return 1


@reader("picture")
def read_png(path: str | Path) -> np.ndarray:
    """Return pixels (h, w) or (h, w, 3; RGB order) with the depth of the file, upright by the EXIF orientation.

    Transparency is dropped.
    """
    import cv2

    content = Path(path).read_bytes()
    width, height = _size(content)
    if width * height > MAX_PIXELS:
        raise FormatError(f"{width} x {height} pixels, expected at most {MAX_PIXELS / 1e6:.0f} megapixels")
    if (own := _decode_own(content)) is not None:
        return own
    # Without IMREAD_UNCHANGED, OpenCV applies the EXIF orientation.
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR)
    if pixels is None:
        raise FormatError("no readable image")
    if pixels.ndim == 3:
        pixels = pixels[..., [2, 1, 0]]
    return np.asarray(pixels)


@reader("picture")
def size(path: str | Path) -> tuple[int, int]:
    """Return width and height in pixels, upright by the EXIF orientation, from the header of the file."""
    return _size(Path(path).read_bytes())


def _size(content: bytes) -> tuple[int, int]:
    if content.startswith(_SIGNATURE):
        header = parse_header(content)  # OpenCV reads truncated and damaged files without an error
        width, height, orientation = header.width, header.height, header.orientation
    elif content.startswith(_TIFF):
        width, height, orientation = _tiff_size(content)
    else:
        width, height, orientation = _pillow_size(content)
    return (height, width) if orientation in _TRANSPOSED else (width, height)


def _tiff_size(content: bytes) -> tuple[int, int, int]:
    import tifffile

    with tifffile.TiffFile(io.BytesIO(content)) as tiff:
        page: Any = tiff.pages[0]
        if page.samplesperpixel > _MAX_BANDS:
            raise FormatError(f"{page.samplesperpixel} bands, expected 1 to {_MAX_BANDS}")
        orientation = page.tags.get(_ORIENTATION)
        return int(page.imagewidth), int(page.imagelength), 1 if orientation is None else int(orientation.value)


def _pillow_size(content: bytes) -> tuple[int, int, int]:
    from PIL import Image, UnidentifiedImageError

    Image.MAX_IMAGE_PIXELS = None  # the caller checks the size
    try:
        with Image.open(io.BytesIO(content)) as image:
            exif = image.info.get("exif", b"")
            return image.width, image.height, _orientation(exif) if exif else 1
    except UnidentifiedImageError as error:
        raise FormatError("no readable image" if content else "the file is empty") from error


@reader("photo")
def read_photo(path: str | Path, size: tuple[int, int] | None) -> np.ndarray:
    """Read a photo (h, w) in polarsim's format: uint16 with 12-bit values.

    `size`: expected width and height, px; None: any size.
    """
    pixels = read_png(path)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise FormatError(
            f"{pixels.dtype} with shape {pixels.shape}, expected a photo with a single channel of 16 bits", path=path
        )
    if size is not None and (pixels.shape[1], pixels.shape[0]) != size:
        raise FormatError(f"{pixels.shape[1]} x {pixels.shape[0]} pixels, expected {size[0]} x {size[1]}", path=path)
    if pixels.max(initial=0) > WHITE_LEVEL:
        raise FormatError(f"value {pixels.max()}, expected 12 bits (0 to {WHITE_LEVEL})", path=path)
    return pixels


def write_png(path: str | Path, pixels: np.ndarray) -> None:
    """Write (h, w) or (h, w, 3; RGB order) pixels, uint8 or uint16."""
    write_bytes(path, encode_png(pixels))


def encode_png(pixels: np.ndarray) -> bytes:
    """Return the PNG file of (h, w) or (h, w, 3; RGB order) pixels, uint8 or uint16.

    Rows are stored as differences between adjacent pixels (filter "Sub"). Intel's deflate is five times as fast as
    OpenCV's.
    """
    assert pixels.dtype in (np.uint8, np.uint16)
    assert pixels.shape[2:] in ((), (3,))
    height, width = pixels.shape[:2]
    bits = 8 * pixels.itemsize
    step = pixels.itemsize * (3 if pixels.ndim == 3 else 1)  # bytes from a pixel to the next
    rows = np.ascontiguousarray(pixels, f">u{pixels.itemsize}").view(np.uint8).reshape(height, width * step)
    filtered = np.empty((height, 1 + width * step), np.uint8)
    filtered[:, 0] = _FILTER_SUB
    filtered[:, 1 : 1 + step] = rows[:, :step]
    np.subtract(rows[:, step:], rows[:, :-step], out=filtered[:, 1 + step :])
    header = struct.pack(">IIBBBBB", width, height, bits, 2 if pixels.ndim == 3 else 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", _deflate(filtered.ravel())), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(kind, content) for kind, content in parts)


def _decode_own(content: bytes) -> np.ndarray | None:
    """Return the pixels of a file as `encode_png` writes it, in half the time of OpenCV; None for any other file."""
    from isal import isal_zlib

    start, end = len(_SIGNATURE) + 33, len(content) - 16  # of the compressed rows in a file of three chunks
    kinds = content[12:16], content[start - 4 : start], content[end + 8 : end + 12]
    if kinds != (b"IHDR", b"IDAT", b"IEND") or content[start - 8 : start - 4] != struct.pack(">I", end - start):
        return None
    width, height, bits, colour, *methods = struct.unpack(">IIBBBBB", content[16:29])
    if bits not in (8, 16) or colour not in (0, 2) or any(methods) or not width * height:
        return None
    step = bits // 8 * _CHANNELS[colour]
    size = height * (1 + width * step)
    rows = np.frombuffer(
        isal_zlib.decompressobj().decompress(memoryview(content)[start:end], max_length=size + 1), np.uint8
    )
    if len(rows) != size or (rows[:: 1 + width * step] != _FILTER_SUB).any():
        return None
    differences = rows.reshape(height, 1 + width * step)[:, 1:].reshape(height, width, step)
    values = np.add.accumulate(differences, axis=1, dtype=np.uint8).view(f">u{bits // 8}")
    pixels = values.astype(f"u{bits // 8}", copy=False)
    return pixels if colour == 2 else pixels[..., 0]


def _deflate(content: np.ndarray) -> bytes:
    """Compress (n,) bytes; the result depends on the bytes only.

    At the start of a stream, ISA-L (2.32.1, `.write_first_byte` of `igzip_icf_body_h1_gr_bt.asm`) computes the
    hash of the third byte from a register that contains the address of the stream. Addresses vary between threads
    and processes, and therefore some files did, about 1 in thousands. Inputs of 4 to 16 bytes use a different, correct
    code path and create a history, after which the rest of the stream does not execute that instruction.
    """
    from isal import isal_zlib

    stream = isal_zlib.compressobj(_LEVEL)
    start = stream.compress(content[:_FIRST]) + stream.flush(isal_zlib.Z_SYNC_FLUSH)
    return start + stream.compress(content[_FIRST:]) + stream.flush()


def _chunk(kind: bytes, content: bytes) -> bytes:
    from isal import isal_zlib

    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", isal_zlib.crc32(kind + content))

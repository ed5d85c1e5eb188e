import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import png
from polarsim.photo import HEIGHT, WIDTH

SMALL = (24, 16)  # width, height


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def written_by_hand(pixels: np.ndarray, bits: int, colour: int) -> bytes:
    """A PNG after the specification, without filters: independent of OpenCV."""
    height, width = pixels.shape[:2]
    rows = pixels.astype(">u2" if bits == 16 else "u1").reshape(height, -1)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")


@pytest.fixture
def ramp(rng) -> np.ndarray:
    return rng.integers(16, 4096, (SMALL[1], SMALL[0]), dtype=np.uint16)


def test_a_16_bit_picture_of_another_writer_is_read(tmp_path, ramp):
    (tmp_path / "a.png").write_bytes(written_by_hand(ramp, 16, 0))
    np.testing.assert_array_equal(png.read_photo(tmp_path / "a.png", SMALL), ramp)


@pytest.mark.parametrize(("kind", "shape"), [("uint16", (16, 24)), ("uint8", (16, 24)), ("uint8", (16, 24, 3))])
def test_pictures_read_back_bit_by_bit(tmp_path, rng, kind, shape):
    pixels = rng.integers(0, np.iinfo(kind).max, shape, dtype=kind, endpoint=True)
    png.write(tmp_path / "a.png", pixels)
    np.testing.assert_array_equal(png.read(tmp_path / "a.png"), pixels)


def test_colours_are_in_the_order_red_green_blue(tmp_path):
    red = np.zeros((4, 4, 3), np.uint8)
    red[..., 0] = 255
    (tmp_path / "a.png").write_bytes(written_by_hand(red, 8, 2))
    np.testing.assert_array_equal(png.read(tmp_path / "a.png"), red)


def test_the_same_pixels_give_the_same_bytes(tmp_path, ramp):
    png.write(tmp_path / "a.png", ramp)
    png.write(tmp_path / "b.png", ramp)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("pixels", "reason"),
    [
        (np.zeros((16, 25), np.uint16), "25 x 16 pixels, expected 24 x 16"),
        (np.zeros((16, 24), np.uint8), "uint8"),
        (np.zeros((16, 24, 3), np.uint16), "one channel of 16 bits"),
        (np.full((16, 24), 4096, np.uint16), "value 4096, a photo has 12 bits"),
    ],
)
def test_a_photo_of_another_size_or_depth_is_refused(tmp_path, pixels, reason):
    png.write(tmp_path / "a.png", pixels)
    with pytest.raises(FormatError, match=rf"a\.png: .*{reason}"):
        png.read_photo(tmp_path / "a.png", SMALL)


def test_a_missing_picture_and_one_that_is_none_are_refused(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    for name in ("none.png", "text.png"):
        with pytest.raises(FormatError, match=rf"{name}: no readable picture"):
            png.read(tmp_path / name)


def test_a_picture_that_cannot_be_written_is_one_line(tmp_path, ramp):
    (tmp_path / "file").write_text("")
    with pytest.raises(PolarsimError, match=r"file/a\.png: cannot be written"):
        png.write(tmp_path / "file" / "a.png", ramp)


@pytest.mark.parametrize(("bits", "colour", "channels"), [(16, 0, 1), (8, 0, 1), (8, 2, 3), (16, 6, 4)])
def test_the_header_states_size_bits_and_channels(bits, colour, channels):
    content = written_by_hand(np.zeros((3, 5, channels)), bits, colour)
    assert png.parse_header(content) == png.Header(5, 3, bits, channels)


def test_the_header_of_a_written_photo_is_nasas(tmp_path):
    png.write(tmp_path / "a.png", np.full((HEIGHT, WIDTH), 16, np.uint16))
    assert png.parse_header((tmp_path / "a.png").read_bytes()) == png.Header(1936, 1216, 16, 1)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_cut_or_changed_file_never_has_a_header(ramp, data):
    content = bytearray(written_by_hand(ramp, 16, 0))
    position = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        del content[position:]
    else:
        content[position] ^= data.draw(st.integers(1, 255))  # a checksum finds every change of one byte
    with pytest.raises(FormatError):
        png.parse_header(bytes(content))

import io
import struct
import threading
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageOps

from polarsim.errors import FormatError
from polarsim.formats import png

SMALL = (24, 16)  # width, height


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def written_by_hand(pixels: np.ndarray, bits: int, colour: int) -> bytes:
    """A PNG after the specification, without filters: independent of OpenCV."""
    height, width = pixels.shape[:2]
    rows = pixels.astype(">u2" if bits == 16 else "u1").reshape(height, -1)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    return png_file(raw, (height, width), bits, colour)


def png_file(raw: bytes, shape: tuple[int, int], bits: int, colour: int) -> bytes:
    """A PNG of filtered rows in a single data chunk."""
    header = struct.pack(">IIBBBBB", shape[1], shape[0], bits, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")


@pytest.fixture
def ramp(rng) -> np.ndarray:
    return rng.integers(16, 4096, (SMALL[1], SMALL[0]), dtype=np.uint16)


def test_a_16_bit_image_written_by_hand_is_read(tmp_path, ramp):
    (tmp_path / "a.png").write_bytes(written_by_hand(ramp, 16, 0))
    np.testing.assert_array_equal(png.read_photo(tmp_path / "a.png", SMALL), ramp)


@pytest.mark.parametrize(("kind", "shape"), [("uint16", (16, 24)), ("uint8", (16, 24)), ("uint8", (16, 24, 3))])
def test_images_read_back_exactly(tmp_path, rng, kind, shape):
    pixels = rng.integers(0, np.iinfo(kind).max, shape, dtype=kind, endpoint=True)
    png.write_png(tmp_path / "a.png", pixels)
    np.testing.assert_array_equal(png.read_png(tmp_path / "a.png"), pixels)


@settings(max_examples=60)
@given(data=st.data())
def test_files_are_read_as_by_opencv(tmp_path_factory, data):
    # Files of one data chunk, with the filters of PNG or with the wrong number of bytes, resemble polarsim's own.
    height, width, bits, colour = (
        data.draw(st.sampled_from(choices)) for choices in ((1, 2, 7), (1, 3, 9), (8, 16), (0, 2))
    )
    length = width * bits // 8 * (3 if colour else 1)
    filters = data.draw(st.one_of(st.just([1] * height), st.lists(st.integers(0, 4), min_size=height, max_size=height)))
    raw = b"".join(bytes([kind]) + data.draw(st.binary(min_size=length, max_size=length)) for kind in filters)
    raw += data.draw(st.sampled_from([b"", b"\1", raw]))
    path = tmp_path_factory.mktemp("png") / "a.png"
    path.write_bytes(png_file(raw, (height, width), bits, colour))
    expected = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    pixels = png.read_png(path)
    assert pixels.dtype == expected.dtype
    np.testing.assert_array_equal(pixels, expected[..., ::-1] if colour else expected)


def repeated_rows(seed: int = 0) -> list[np.ndarray]:
    """Small images of equal rows: their streams refer to the first bytes, and ISA-L's hash table is small."""
    rng = np.random.default_rng(seed)
    return [np.tile(rng.integers(0, 256, (1, width), np.uint8), (4, 1)) for width in (5, 6, 7, 9, 12, 20)]


def test_threads_with_different_stacks_give_the_same_bytes():
    images = repeated_rows()
    expected = [png.encode_png(image) for image in images]
    found, done = [], threading.Event()

    def encode_and_wait():
        found.append([png.encode_png(image) for image in images])
        done.wait()

    former = threading.stack_size(1 << 18)  # the stream of ISA-L needs 80 KB
    threads = [threading.Thread(target=encode_and_wait) for _ in range(300)]  # with separate stacks
    try:
        for thread in threads:
            thread.start()
    finally:
        done.set()
        threading.stack_size(former)
    for thread in threads:
        thread.join()
    assert len(found) == 300
    assert all(encoded == expected for encoded in found)


@settings(max_examples=60)
@given(st.integers(1, 40), st.integers(1, 40), st.sampled_from(["uint8", "uint16"]), st.integers(0, 2**32 - 1))
def test_encoded_images_decode_to_their_pixels(height, width, kind, seed):
    rng = np.random.default_rng(seed)
    pixels = rng.integers(0, rng.integers(1, np.iinfo(kind).max), (height, width), kind, endpoint=True)
    with Image.open(io.BytesIO(png.encode_png(pixels))) as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((16, 25), np.uint16),
        np.zeros((16, 24), np.uint8),
        np.zeros((16, 24, 3), np.uint16),
        np.full((16, 24), 4096, np.uint16),
    ],
)
def test_a_photo_of_another_size_or_depth_is_an_error(tmp_path, pixels):
    png.write_png(tmp_path / "a.png", pixels)
    with pytest.raises(FormatError, match=r"a\.png"):
        png.read_photo(tmp_path / "a.png", SMALL)


@pytest.mark.parametrize(("bits", "colour", "channels"), [(16, 0, 1), (8, 0, 1), (8, 2, 3), (16, 6, 4)])
def test_the_header_states_size_bits_and_channels(bits, colour, channels):
    content = written_by_hand(np.zeros((3, 5, channels)), bits, colour)
    assert png.parse_header(content) == png.Header(5, 3, bits, channels)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_truncated_or_changed_file_is_an_error(ramp, data):
    content = bytearray(written_by_hand(ramp, 16, 0))
    position = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        del content[position:]
    else:
        content[position] ^= data.draw(st.integers(1, 255))  # a checksum detects every change of a single byte
    with pytest.raises(FormatError):
        png.parse_header(bytes(content))


TURNS = {
    1: lambda pixels: pixels,
    2: lambda pixels: pixels[:, ::-1],
    3: lambda pixels: pixels[::-1, ::-1],
    4: lambda pixels: pixels[::-1],
    5: lambda pixels: np.swapaxes(pixels, 0, 1),
    6: lambda pixels: np.rot90(pixels, -1),
    7: lambda pixels: np.swapaxes(pixels, 0, 1)[::-1, ::-1],
    8: lambda pixels: np.rot90(pixels),
}
KINDS = {"a.png": "uint8", "b.png": "uint16", "a.jpg": "uint8", "a.tif": "uint8", "b.tif": "uint16", "a.webp": "uint8"}


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("orientation", TURNS)
def test_images_are_upright_as_viewers_show_them(tmp_path, rng, name, orientation):
    for colour in (False, True) if KINDS[name] == "uint8" else (False,):  # Pillow writes no colours of 16 bits
        blocks = rng.integers(0, 200, (3, 5, 3)) * (256 if KINDS[name] == "uint16" else 1)
        stored = np.kron(blocks, np.ones((16, 16, 1), int)).astype(KINDS[name])
        stored = stored if colour else stored[..., 0]
        exif = Image.Exif()
        exif[0x0112] = orientation
        options = {"tiffinfo": {0x0112: orientation}} if name.endswith(".tif") else {"exif": exif.tobytes()}
        if name.endswith((".jpg", ".webp")):
            options.update({"quality": 100, "subsampling": 0} if name.endswith(".jpg") else {"lossless": True})
        Image.fromarray(stored).save(tmp_path / name, **options)
        pixels = png.read_png(tmp_path / name)
        assert png.size(tmp_path / name) == (pixels.shape[1], pixels.shape[0])
        shown = pixels if pixels.ndim == stored.ndim else pixels[..., 0]  # WebP has no grey
        np.testing.assert_allclose(shown.astype(int), TURNS[orientation](stored).astype(int), atol=3)
        if not name.endswith(".tif"):  # Pillow turns some of them twice
            with Image.open(tmp_path / name) as image:
                assert np.asarray(ImageOps.exif_transpose(image)).shape[:2] == pixels.shape[:2]


def test_an_orientation_after_the_pixels_is_applied(tmp_path):
    content = written_by_hand(np.arange(12, dtype=np.uint8).reshape(3, 4), 8, 0)
    exif = Image.Exif()
    exif[0x0112] = 6
    end = content.index(b"IEND") - 4
    (tmp_path / "a.png").write_bytes(content[:end] + chunk(b"eXIf", exif.tobytes()[6:]) + content[end:])
    pixels = png.read_png(tmp_path / "a.png")
    assert png.size(tmp_path / "a.png") == (pixels.shape[1], pixels.shape[0]) == (3, 4)


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.tif", "a.bmp"])
def test_images_of_large_cameras_are_read(tmp_path, name):
    Image.fromarray(np.full((4000, 6000), 90, np.uint8)).save(tmp_path / name)
    assert png.size(tmp_path / name) == (6000, 4000)
    assert png.read_png(tmp_path / name).shape == (4000, 6000)


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_images_above_the_limit_are_errors(tmp_path, monkeypatch, name):
    monkeypatch.setattr(png, "MAX_PIXELS", 100)
    Image.fromarray(np.zeros((10, 11), np.uint8)).save(tmp_path / name)
    with pytest.raises(FormatError):
        png.read_png(tmp_path / name)


@pytest.mark.parametrize(
    "exif", [b"", b"Exif\0\0", b"Exif\0\0II*\0\xff\xff\xff\xff", b"Exif\0\0MM\0*\0\0\0\x08\0\x09" + bytes(9)]
)
def test_an_image_with_damaged_exif_is_read_as_stored(tmp_path, exif):
    Image.fromarray(np.zeros((12, 16), np.uint8)).save(tmp_path / "a.jpg", exif=exif)
    assert png.size(tmp_path / "a.jpg") == (16, 12)
    assert png.read_png(tmp_path / "a.jpg").shape == (12, 16)


def test_colours_are_in_the_order_red_green_blue(tmp_path):
    red = np.zeros((4, 4, 3), np.uint8)
    red[..., 0] = 255
    (tmp_path / "a.png").write_bytes(written_by_hand(red, 8, 2))
    np.testing.assert_array_equal(png.read_png(tmp_path / "a.png"), red)

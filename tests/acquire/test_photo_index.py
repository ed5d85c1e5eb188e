import hashlib

import numpy as np
import pytest

from polarsim.acquire.index import describe_photo, index_photos, photo_table
from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.tables import PHOTO_COLUMNS
from polarsim.photo import PhotoKey
from polarsim.site import polar
from polarsim.sources.files import log_gaps
from tests.support.polar_photos import HEIGHT, WIDTH

KEY = PhotoKey.parse("01_A_off_180_L_0256")


@pytest.fixture(scope="module")
def photo(tmp_path_factory):
    path = tmp_path_factory.mktemp("photos") / "CamL_1_0256.png"
    png.write_png(path, np.full((HEIGHT, WIDTH), 16, np.uint16))
    return path


def test_a_photo_is_described_by_its_size_bits_and_checksum(photo):
    assert describe_photo(photo, (WIDTH, HEIGHT)) == {
        "width": 1936, "height": 1216, "bits": 16, "path": photo.as_posix(),
        "sha256": hashlib.sha256(photo.read_bytes()).hexdigest(),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("shape", "kind"), [((HEIGHT, WIDTH), np.uint8), ((HEIGHT, WIDTH, 3), np.uint16), ((WIDTH, HEIGHT), np.uint16)]
)
def test_a_photo_of_another_size_or_depth_is_an_error(tmp_path, shape, kind):
    png.write_png(tmp_path / "a.png", np.zeros(shape, kind))
    with pytest.raises(FormatError, match=r"a\.png"):
        describe_photo(tmp_path / "a.png", (WIDTH, HEIGHT))


def test_the_index_has_a_row_per_photo_sorted_by_key(photo):
    other = PhotoKey.parse("01_A_off_180_R_0256")
    table = index_photos([(other, photo), (KEY, photo)], (WIDTH, HEIGHT))
    assert tuple(table.columns) == PHOTO_COLUMNS
    assert table["key"].tolist() == [str(KEY), str(other)]
    assert table.loc[0, ["terrain", "position", "light", "azimuth", "camera", "exposure_ms"]].tolist() == [
        1, "A", "off", "180", "L", 256,
    ]  # fmt: skip


def test_an_index_without_photos_has_the_same_types(photo):
    assert photo_table([]).dtypes.equals(index_photos([(KEY, photo)], (WIDTH, HEIGHT)).dtypes)


GRID = [key for key in polar().photos_of(1) if key.position == "A"]


@pytest.mark.parametrize(
    ("lost", "messages"),
    [
        ([], []),
        ([KEY], ["1 of the grid missing, 1 without the photo of the second camera, such as 01_A_off_180_R_0256"]),
        ([KEY, KEY.other_camera], [f"2 of the grid missing, 0 without the photo of the second camera, such as {KEY}"]),
    ],
)
def test_gaps_are_photos_of_the_grid_and_photos_without_second_camera(tmp_path, caplog, lost, messages):
    log_gaps([key for key in GRID if key not in lost], GRID, tmp_path, stereo=True)
    assert [record.getMessage().partition(" photos found, ")[2] for record in caplog.records] == messages

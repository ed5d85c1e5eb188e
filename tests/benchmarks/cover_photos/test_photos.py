"""Cover photos become a test set, paired with their labels."""

import numpy as np
import pytest

from benchmarks.cover_photos.photos import pair_covers, read_covers
from polarsim.errors import DetectError
from polarsim.formats import png, tables
from polarsim.photo import PhotoKey
from tests.benchmarks.cover_photos.conftest import KEY, ROCKS


def test_a_cover_fits_the_labels_of_its_own_camera_only(made_release):
    pair_covers(made_release, [KEY], made_release / "pairing.csv")
    table = tables.read_csv(made_release / "pairing.csv").set_index("camera")
    assert table.loc["L", "shown"]
    assert not table.loc["R", "shown"]
    assert (table[["drawn", "labels"]] == 2).all(axis=None)
    assert table.loc["L", "score"] > 0.8
    assert table.loc["R", "score"] == 0


def test_a_cover_is_read_without_strokes_and_with_its_published_boxes(made_release):
    read_covers(root=made_release, keys=[KEY], pictures=made_release / "photos", labels=made_release / "labels.parquet")
    np.testing.assert_allclose(png.read(made_release / "photos" / f"{KEY}.png").astype(int), 90, atol=2)
    table = tables.read_parquet(made_release / "labels.parquet", tables.LABEL_COLUMNS)
    rocks = table.loc[table["kind"] == "rock", ["x0", "y0", "x1", "y1"]].to_numpy()
    np.testing.assert_allclose(rocks[np.argsort(rocks[:, 0])], ROCKS, atol=0.01)


@pytest.mark.parametrize("key", ["01_C_off_30_L_0256", "02_A_off_30_L_0256"])
def test_a_cover_that_is_not_there_is_named(made_release, key):
    with pytest.raises(DetectError, match="no cover photo"):
        read_covers(
            root=made_release, keys=[PhotoKey.parse(key)], pictures=made_release / "p", labels=made_release / "l"
        )

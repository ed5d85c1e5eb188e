import numpy as np
import pytest

from polarsim.errors import LabelError
from polarsim.formats.yolo import read_rock_boxes
from polarsim.photo import PhotoKey
from tests.support.polar_photos import SIZE


def test_only_rocks_in_left_seeds_of_the_terrain_are_read(tmp_path):
    for camera, lines in (("L", "0 0.5 0.5 0.1 0.1\n1 0.2 0.2 0.1 0.1\n"), ("R", "0 0.1 0.1 0.1 0.1\n")):
        key = PhotoKey(1, "A", "off", "30", camera, 256)
        (tmp_path / f"{key}.txt").write_text(lines)
    boxes = read_rock_boxes(tmp_path, 1, size=SIZE)
    np.testing.assert_allclose(
        np.concatenate(boxes["A"]), [[871.2, 547.2, 1064.8, 668.8]]
    )  # 0.45 and 0.55 of 1936 and 1216
    assert read_rock_boxes(tmp_path, 3, size=SIZE) == {}


def test_a_seed_without_photo_key_is_an_error(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(LabelError, match=r"notes\.txt"):
        read_rock_boxes(tmp_path, 1, size=SIZE)

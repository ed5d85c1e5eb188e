import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.run_files.instances import read_kind_masks


def test_rocks_and_shadows_are_separate_and_relief_is_neither(tmp_path):
    png.write_png(
        tmp_path / "ids.png", np.array([[0, 1, 2, 1000, 1901, 2000, 2901]], np.uint16)
    )  # as stated in docs/formats.md
    masks = read_kind_masks(tmp_path / "ids.png")
    assert masks["rock"].tolist() == [[False, False, False, True, True, False, False]]
    assert masks["shadow"].tolist() == [[False, False, False, False, False, True, True]]


def test_a_grey_map_is_an_error(tmp_path):
    png.write_png(tmp_path / "ids.png", np.zeros((4, 4), np.uint8))
    with pytest.raises(FormatError, match=r"ids\.png"):
        read_kind_masks(tmp_path / "ids.png")

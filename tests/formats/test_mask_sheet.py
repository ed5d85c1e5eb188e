import numpy as np
import pytest

from polarsim.formats import png
from polarsim.formats.mask_sheet import (
    CLASS_COLOURS,
    MAX_TILES,
    TILE_WIDTH,
    colour_of_mask,
    tile_of_mask,
    write_mask_sheet,
)  # fmt: skip
from polarsim.photo import GREY_VALUES


def test_every_class_has_its_colour_and_other_values_stay_grey():
    shown = colour_of_mask(np.array([[*GREY_VALUES.values(), 77]], np.uint8))
    assert [tuple(pixel) for pixel in shown[0]] == [*(CLASS_COLOURS[kind] for kind in GREY_VALUES), (77, 77, 77)]


def test_a_tile_keeps_the_shares_of_the_classes():
    grey = np.full((608, 968), GREY_VALUES["ground"], np.uint8)
    grey[:304] = GREY_VALUES["rock"]
    tile = tile_of_mask(grey)
    assert tile.shape[1] == TILE_WIDTH
    assert (tile == CLASS_COLOURS["rock"]).all(axis=-1).mean() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("count", [0, 1, 5, MAX_TILES + 7])
def test_a_sheet_has_a_row_per_four_masks_up_to_a_maximum(tmp_path, count):
    tiles = {f"mask {number}": np.full((20, TILE_WIDTH, 3), 90, np.uint8) for number in range(count)}
    write_mask_sheet(tmp_path / "sheet.png", tiles)
    shown = png.read_png(tmp_path / "sheet.png")
    assert shown.shape[0] == 36 + -(-min(count, MAX_TILES) // 4) * 50
    assert (shown == 90).all(axis=-1).sum() == min(count, MAX_TILES) * 20 * TILE_WIDTH

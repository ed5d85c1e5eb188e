import pandas as pd
import pytest

from polarsim.detect.false_positives import TERRAIN, TILES, false_positives
from tests.support.polar_photos import HEIGHT, WIDTH

EMPTY, ROCKY, OTHER_VIEW = "06_A_off_180_L_0256", "01_A_off_180_L_0256", "06_A_off_180_R_0256"


def table(*rows, **columns):
    return pd.DataFrame(
        [(key, kind, *box) for key, kind, box in rows], columns=["key", "kind", "x0", "y0", "x1", "y1"]
    ).assign(**columns)


LABELS = table((ROCKY, "rock", (300, 350, 400, 450)), (EMPTY, "shadow", (0, 0, 50, 50)))  # inside tile (1, 1)


def rates(*rows, keys=(EMPTY, OTHER_VIEW, ROCKY), **options):
    options = {"confidence": 0.25, "resamples": 200} | options
    found = table(*rows, confidence=0.9)
    return false_positives(list(keys), LABELS, found, size=(WIDTH, HEIGHT), **options).set_index("region")


def test_the_evaluated_area_is_the_photo_or_its_free_tiles():
    found = rates()
    assert found.loc[TERRAIN, ["terrains", "images", "photo_areas", "false_positives"]].tolist() == ["06", 2, 2, 0]
    assert found.loc[TILES, ["terrains", "images", "photo_areas"]].tolist() == ["01", 1, 31 / 32]


def test_rates_are_false_positives_over_photos_and_covered_over_free_area():
    found = rates((EMPTY, "rock", (100, 100, 200, 300)), (EMPTY, "rock", (100, 200, 200, 400))).loc[TERRAIN]
    assert found["false_positives"] == 2
    assert found["per_photo"] == 1  # of two photos
    assert found["area_share"] == pytest.approx(100 * 300 / (2 * WIDTH * HEIGHT))  # overlap counted once
    assert (found["per_photo_low"], found["per_photo_high"]) == (0, 2)  # replicates with a single view


def test_shadows_and_unsure_boxes_are_no_false_rocks():
    assert rates((EMPTY, "shadow", (100, 100, 200, 300))).loc[TERRAIN, "false_positives"] == 0
    assert rates((EMPTY, "rock", (100, 100, 200, 300)), confidence=0.95).loc[TERRAIN, "false_positives"] == 0


def test_a_false_positive_belongs_to_the_tile_of_its_centre():
    aside = (484 - 42, 350, 484 + 142, 400)  # from the tile of the rock (right border 484) into the next tile
    found = rates((ROCKY, "rock", aside)).loc[TILES]
    assert found["false_positives"] == 1
    assert found["area_share"] == pytest.approx(142 * 50 / (31 / 32 * WIDTH * HEIGHT))
    inside = rates((ROCKY, "rock", (250, 310, 290, 340))).loc[TILES]
    assert inside[["false_positives", "area_share"]].tolist() == [0, 0]


def test_a_box_inside_or_around_a_label_is_not_a_false_positive():
    assert rates((ROCKY, "rock", (310, 360, 330, 380))).loc[TILES, "false_positives"] == 0
    assert rates((ROCKY, "rock", (0, 0, 1900, 1200))).loc[TILES, "false_positives"] == 0


def test_unlabelled_photos_of_terrains_with_rocks_use_tiles():
    found = rates(keys=("01_A_off_180_R_0256",))
    assert found.index.tolist() == [TILES]
    assert found.loc[TILES, "photo_areas"] == 1


def test_rates_do_not_depend_on_the_size_and_the_names_of_photos():
    """Photos of a third of the size, of a terrain with a name: tiles and areas are shares of the photo."""
    boxes = [(100, 100, 200, 300), (850, 300, 1000, 620)]
    large = rates(*((ROCKY, "rock", box) for box in boxes), keys=(ROCKY,))
    key = ROCKY.replace("01", "yard-a")
    (rock,) = LABELS[LABELS["kind"] == "rock"][["x0", "y0", "x1", "y1"]].to_numpy() / 3
    labels = table((key, "rock", rock))
    found = table(*((key, "rock", [edge / 3 for edge in box]) for box in boxes), confidence=0.9)
    size = (WIDTH / 3, HEIGHT / 3)
    small = false_positives([key], labels, found, size=size, confidence=0.25, resamples=200).set_index("region")
    assert small.loc[TILES, "terrains"] == "yard-a"
    numbers = ["photo_areas", "false_positives", "area_share"]
    assert small.loc[TILES, numbers].tolist() == pytest.approx(large.loc[TILES, numbers].tolist())

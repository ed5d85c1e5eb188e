"""Masks against polygons, with known IoU."""

import numpy as np
import pytest

from polarsim.errors import FormatError, LabelError
from polarsim.formats import yolo
from polarsim.formats.release import polygon_folder
from polarsim.formats.tables import read_csv, read_parquet
from polarsim.photo import POLYGON_CLASSES, PhotoKey
from polarsim.report.covers_table import tabulate_masks
from polarsim.run_files import class_masks
from polarsim.schemas.covers import MASK_SCORES
from polarsim.scoring.masks import score_masks
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

FIRST, SECOND, WITHOUT = (PhotoKey.parse(f"03_{position}_off_30_L_0256") for position in "ABC")
GROUND, ROCK, SHADOW = range(3)
SAND_FROM = 216  # row of the photo; above it people painted background


def ring(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)


def painted(*things):
    """Polygons of sand and of things (class name, box)."""
    sand = ("ground", (0, SAND_FROM, WIDTH, HEIGHT))
    return [(POLYGON_CLASSES.index(name), ring(*box)) for name, box in (*things, sand)]


def mask(*things):
    shown = np.zeros((HEIGHT, WIDTH), np.uint8)
    for number, (x0, y0, x1, y1) in things:
        shown[y0:y1, x0:x1] = number
    return shown


@pytest.fixture
def scores(tmp_path):
    """IoU by region, photo and class."""

    def run(polygons, masks):
        for key, annotated in polygons.items():
            yolo.write_polygons(polygon_folder(tmp_path, 3) / f"{key}.txt", annotated, size=SIZE)
        for key, shown in masks.items():
            class_masks.write_class_mask(tmp_path / f"masks/{key}.png", shown)
        score_masks(
            size=(WIDTH, HEIGHT),
            masks=[tmp_path / "masks"],
            root=tmp_path,
            scores=tmp_path / "scores.parquet",
            seed=0,
            resamples=100,
        )
        table = read_parquet(tmp_path / "scores.parquet", MASK_SCORES.columns)
        return table.set_index(["region", "key", "kind"]).sort_index()

    return run


def test_iou_agrees_with_a_hand_calculation_with_a_detection_outside_the_sand(scores):
    """A rock of 100 x 100 px detected 50 px to the right, and a false positive of equal size in the background."""
    table = scores(
        {FIRST: painted(("rock", (500, 600, 600, 700)))},
        {FIRST: mask((ROCK, (550, 600, 650, 700)), (ROCK, (100, 50, 200, 150)))},
    )
    sand, photo = (table.loc[region, str(FIRST)] for region in ("sand", "photo"))
    assert sand.loc["rock", "iou"] == pytest.approx(5000 / 15000)
    assert photo.loc["rock", "iou"] == pytest.approx(5000 / 25000)
    whole = WIDTH * (HEIGHT - SAND_FROM)
    assert sand.loc["ground", "iou"] == pytest.approx((whole - 15000) / (whole - 5000))
    assert sand.loc["rock", "pixels"] == 10000
    assert np.isnan(sand.loc["shadow", "iou"])  # neither annotated nor detected


def test_photos_with_polygons_are_pooled_with_an_interval(scores, tmp_path):
    box = (500, 600, 600, 700)
    table = scores(
        {key: painted(("rock", box), ("shadow", (600, 600, 800, 700))) for key in (FIRST, SECOND)},
        {FIRST: mask((ROCK, box)), SECOND: mask((SHADOW, (600, 600, 800, 700))), WITHOUT: mask()},
    )
    own = table.loc["sand"]
    assert [own.loc[(str(key), kind), "iou"] for key in (FIRST, SECOND) for kind in ("rock", "shadow")] == [1, 0, 0, 1]
    assert set(own.index.get_level_values("key")) == {str(FIRST), str(SECOND), "all"}
    every = own.loc["all"]
    assert (every["photos"] == 2).all()
    assert every.loc["rock", "iou"] == 0.5
    assert (every.loc["rock", "iou_low"], every.loc["rock", "iou_high"]) == (0, 1)
    assert own.loc[str(FIRST), "iou_low"].isna().all()
    tabulate_masks(
        scores=tmp_path / "scores.parquet", stem=tmp_path / "masks_table",
        origin={"run": "small", "source": "release", "config": "0"},
    )  # fmt: skip
    assert len(read_csv(tmp_path / "masks_table.csv")) == 18
    assert "0.500 [0.000, 1.000]" in (tmp_path / "masks_table.md").read_text()


def test_polygons_of_the_nearest_exposure_of_a_bracket_are_used(scores):
    near, far = (PhotoKey.parse(f"03_A_off_30_L_{exposure}") for exposure in ("0512", "2048"))
    box = (500, 600, 600, 700)
    table = scores({near: painted(("rock", box)), far: painted()}, {FIRST: mask((ROCK, box))})
    assert table.loc[("sand", str(FIRST), "rock"), "iou"] == 1


def test_masks_that_cannot_be_scored_are_errors(scores):
    with pytest.raises(LabelError, match="no polygons"):
        scores({}, {FIRST: mask()})
    with pytest.raises(LabelError, match=rf"{FIRST}\.png: 20 x 10"):
        scores({FIRST: painted()}, {FIRST: np.zeros((10, 20), np.uint8)})
    with pytest.raises(FormatError, match="value 7"):
        scores({}, {FIRST: np.full((HEIGHT, WIDTH), 7, np.uint8)})

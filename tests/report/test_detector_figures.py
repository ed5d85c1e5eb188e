import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.tables import label_table, write_parquet
from polarsim.report.figures.canvas import PREDICTED, rgb
from polarsim.report.figures.detections import draw_predictions, shown_keys
from polarsim.report.figures.detector_results import read_detector_results
from polarsim.report.figures.detectors import draw_curves, draw_ipd_histogram
from polarsim.report.figures.gap_rocks import draw_gap_rocks, is_well_exposed, most_different
from polarsim.report.training_seeds import seed_means, split_panels, title_suffix
from polarsim.schemas.detect import CURVES, INSTANCES, IPD_ROCKS
from polarsim.site import polar
from tests.report.pixels import coloured, is_drawn
from tests.support.label_rows import label_row
from tests.support.polar_photos import HEIGHT, WIDTH

NARROW = 640  # px
ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
KEYS = ("01_A_off_180_L_0256", "01_A_off_180_L_0512")


@pytest.mark.parametrize("kinds", [("rock", "shadow"), ()])
def test_precision_and_recall_are_drawn_with_and_without_labels(tmp_path, kinds):
    rows = [
        (trained, evaluated, kind, iou, recall, 1 - recall)
        for trained in ("real", "hapke")
        for evaluated in ("real", "hapke")
        for kind in kinds
        for iou in (0.5, 0.75)
        for recall in (0.0, 0.5, 1.0)
    ]
    write_parquet(tmp_path / "c.parquet", pd.DataFrame(rows, columns=list(CURVES.columns)))
    draw_curves(curves=tmp_path / "c.parquet", figure=tmp_path / "c.png", origin=ORIGIN, width=NARROW)
    assert is_drawn(tmp_path / "c.png", NARROW)
    assert (coloured(tmp_path / "c.png") > 0.001) == bool(kinds)


@pytest.mark.parametrize("count", [0, 30])
def test_differences_of_rocks_are_drawn_with_and_without_rocks(tmp_path, count):
    rows = [("photo", 0, "hapke", "real", "hapke", 1, n, "rock", 4, n / 30, 0.5, n / 30 - 0.5) for n in range(1, count)]
    write_parquet(tmp_path / "r.parquet", pd.DataFrame(rows, columns=list(IPD_ROCKS.columns)))
    draw_ipd_histogram(rocks=tmp_path / "r.parquet", figure=tmp_path / "h.png", origin=ORIGIN, width=NARROW)
    assert is_drawn(tmp_path / "h.png", NARROW)
    assert (coloured(tmp_path / "h.png") > 0.001) == bool(count)


def instances_of(*rows):
    return pd.DataFrame(rows, columns=["key", "rock", "iou"])


def test_rocks_are_selected_by_mean_and_shown_in_photos_with_nearly_the_largest_difference():
    first = instances_of((KEYS[0], 1, 0.9), (KEYS[1], 1, 0.8), (KEYS[0], 2, 0.5), (KEYS[1], 2, 0.1), (KEYS[0], 3, 0.2))
    second = instances_of((KEYS[0], 1, 0.7), (KEYS[1], 1, 0.1), (KEYS[0], 2, 0.4), (KEYS[1], 2, 0.1), (KEYS[0], 3, 0.9))
    assert most_different(first, second, 1, 256) == [([KEYS[1]], 1), ([KEYS[0]], 3)]
    assert most_different(first, second, 5, 256) == [([KEYS[1]], 1), ([KEYS[0]], 2), ([KEYS[0]], 3)]
    assert most_different(first, first, 5, 256) == []


def test_a_usual_exposure_is_preferred_to_a_slightly_larger_difference():
    first = instances_of((KEYS[1], 1, 0.9), (KEYS[0], 1, 0.8))
    assert most_different(first, first.assign(iou=0.0), 1, 256) == [([KEYS[0], KEYS[1]], 1)]


@pytest.mark.parametrize(("low", "high", "well"), [(20, 200, True), (120, 130, False), (255, 255, False)])
def test_a_crop_without_contrast_or_clipped_is_not_well_exposed(low, high, well):
    crop = np.full((20, 20, 3), low, np.uint8)
    crop[:, 10:] = high
    assert is_well_exposed(crop) == well


@pytest.fixture
def results_of(tmp_path):
    """Return a function that returns results with one label, predicted in real photos only."""
    box = {"x0": 900.0, "y0": 500.0, "x1": 1300.0, "y1": 800.0}
    key = KEYS[0]
    write_parquet(tmp_path / "labels.parquet", label_table([label_row(key, box=box.values())]))
    found = pd.DataFrame([{"key": key, "kind": "rock", "confidence": 0.9} | box | {"x0": 700.0, "y1": 900.0}])
    write_parquet(tmp_path / "hit.parquet", found)
    write_parquet(tmp_path / "miss.parquet", found.assign(confidence=0.1))
    instances = [("real", "real", key, "rock", 1, 0.6, 900.0), ("real", "hapke", key, "rock", 1, 0.0, 900.0)]
    write_parquet(tmp_path / "instances.parquet", pd.DataFrame(instances, columns=list(INSTANCES.columns)))
    photo = np.full((HEIGHT, WIDTH), 1000, np.uint16)

    def read(trained="real", real="hit"):
        return read_detector_results(
            trained, "analog", instances=tmp_path / "instances.parquet",
            predictions={"real": tmp_path / f"{real}.parquet", "hapke": tmp_path / "miss.parquet"},
            labels=dict.fromkeys(("real", "hapke"), tmp_path / "labels.parquet"),
            pixels_of=lambda domain, key: photo if domain == "real" else None, confidence=0.25,
        )  # fmt: skip

    return read


def shows(path, colour):
    pixels = png.read_png(path)[:-50, :, :3].astype(int)  # without the legend
    return bool((np.abs(pixels - colour).max(axis=2) < 60).any())


LABEL, PREDICTION = (255, 176, 0), rgb(PREDICTED)  # colours


@pytest.mark.parametrize("draw", [draw_gap_rocks, draw_predictions])
def test_labels_and_predictions_above_the_minimum_confidence_are_drawn(tmp_path, results_of, draw):
    draw(polar(), results_of(), tmp_path / "hit.png", NARROW)
    assert shows(tmp_path / "hit.png", LABEL)
    assert shows(tmp_path / "hit.png", PREDICTION)
    draw(polar(), results_of(trained="hapke"), tmp_path / "note.png", NARROW)
    assert is_drawn(tmp_path / "note.png", NARROW)


def test_predictions_below_the_minimum_confidence_are_not_drawn(tmp_path, results_of):
    draw_predictions(polar(), results_of(real="miss"), tmp_path / "miss.png", NARROW)
    assert shows(tmp_path / "miss.png", LABEL)
    assert not shows(tmp_path / "miss.png", PREDICTION)


def evaluated(*rows):
    return pd.DataFrame(rows, columns=["evaluated", "key", "rock"])


def test_shown_photos_are_labelled_in_every_domain_with_the_sun_on():
    dark, sunny, other = "01_A_off_no_L_0256", "01_A_off_180_L_0512", "03_A_on_30_L_0256"
    rows = [(domain, key, 1) for domain in ("real", "hapke") for key in (dark, sunny, other)]
    real_only = ("real", "04_A_off_30_L_0256", 1)
    assert [str(key) for key in shown_keys(evaluated(*rows, real_only), 256)] == [sunny, other]
    assert shown_keys(evaluated(("real", sunny, 1), ("hapke", other, 1)), 256) == []
    assert shown_keys(evaluated(), 256) == []


def test_seeds_are_averaged_and_their_intervals_are_merged():
    rows = pd.DataFrame(
        {"trained": ["a", "b", "a"], "seed": [0, 0, 1], "x": [0.2, 0.5, 0.4], "x_low": [0.1, np.nan, 0.3],
         "x_high": [0.3, np.nan, 0.5]}
    )  # fmt: skip
    table = seed_means(rows, ["trained"], ["x"]).set_index("trained")
    assert table.loc["a", ["x", "x_low", "x_high"]].tolist() == pytest.approx([0.3, 0.1, 0.5])
    assert table.loc["a", "x_sd"] == pytest.approx(0.1 * 2**0.5)
    assert table.loc["b", "x"] == 0.5
    assert table.loc["b", ["x_sd", "x_low"]].isna().all()


def test_titles_name_split_and_seeds():
    rows = pd.DataFrame({"split": ["photo", "photo"], "seed": [0, 1]})
    assert title_suffix(rows) == ", split by photo, mean of 2 seeds"
    assert title_suffix(rows.assign(split=["photo", "view"], seed=0)) == ""
    assert [name for name, _ in split_panels(rows.assign(split=["view", "photo"]))] == ["view", "photo"]


def test_each_split_has_panels_and_seeds_have_a_band(tmp_path):
    rows = [
        ("real", "real", "rock", split, seed, 0.5, recall, 0.9 - 0.5 * recall - 0.3 * seed)
        for split in ("photo", "view")
        for seed in (0, 1)
        for recall in (0.0, 0.5, 1.0)
    ]
    columns = ["trained", "evaluated", "kind", "split", "seed", "iou", "recall", "precision"]
    table = pd.DataFrame(rows, columns=columns)

    def drawn(chosen, name):
        write_parquet(tmp_path / "c.parquet", chosen)
        draw_curves(curves=tmp_path / "c.parquet", figure=tmp_path / name, origin=ORIGIN, width=NARROW)
        return png.read_png(tmp_path / name)[..., :3].astype(int)

    both = drawn(table, "both.png")
    single = drawn(table[(table["split"] == "photo") & (table["seed"] == 0)], "single.png")
    assert both.shape[0] > 1.5 * single.shape[0]
    pale = np.array([217, 234, 243])  # 0.15 of the first colour on white

    def has_band(pixels):
        return bool((np.abs(pixels - pale).max(axis=2) < 8).mean() > 0.01)

    assert has_band(both)
    assert not has_band(single)

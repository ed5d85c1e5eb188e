from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from polarsim.detect.ablation import ABLATION_COLUMNS, DomainEvaluation, effect_of, write_ablation
from polarsim.detect.gap_options import Component, GapOptions
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.formats import tables
from polarsim.photo import PhotoKey
from polarsim.schemas.detect import CHANGE_ENDS
from polarsim.schemas.detect import CHANGES as CHANGE_COLUMNS
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

ONE, OTHER = "01_A_off_180_L_0256", "01_A_off_180_R_0256"  # two views
OPTIONS = ComparisonOptions(resamples=1000)
SIDE = 100.0  # side of every rock, px
COLUMNS = ["x0", "y0", "x1", "y1"]
CHANGE_METRICS = list(CHANGE_COLUMNS)
CHANGES = [f"{metric}{end}" for metric in CHANGE_METRICS for end in CHANGE_ENDS if "change" in end]


def boxes(rows, **columns):
    """Return a table of boxes (key, rock, x0, width) of height SIDE at the top of the photo."""
    table = [(key, "rock", rock, x0, 0.0, x0 + width, SIDE) for key, rock, x0, width in rows]
    return pd.DataFrame(table, columns=["key", "kind", "rock", *COLUMNS]).assign(**columns)


def seen(performance, false_positives=(), keys=(ONE, OTHER), options=OPTIONS):
    """Return an evaluation in which rocks (key, rock) have the given IoU and keys have `false_positives`."""
    labels = boxes([(key, rock, SIDE * rock, SIDE) for key, rock in performance])
    found = boxes([(key, rock, SIDE * rock, SIDE * iou) for (key, rock), iou in performance.items()])
    false = [(key, "rock", 0, 0.0, HEIGHT - 50.0, 40.0, float(HEIGHT)) for key in false_positives]
    predictions = pd.concat([found, pd.DataFrame(false, columns=found.columns)], ignore_index=True)
    return DomainEvaluation(keys, labels, predictions.assign(confidence=0.9), options, SIZE)


def rocks(photo, twin, replaced):
    return effect_of(photo, twin, replaced).set_index("kind").loc["rock"]


PHOTO = seen({(ONE, 1): 1.0, (OTHER, 1): 0.5})
TWIN = seen({(ONE, 1): 0.5, (OTHER, 1): 0.4})  # worse by 0.5 and by 0.1


def test_the_change_of_two_views_is_that_of_a_hand_computed_bootstrap():
    found = rocks(PHOTO, TWIN, seen({(ONE, 1): 0.7, (OTHER, 1): 0.4}))  # worse by 0.3 and by 0.1
    assert found[["pairs", "units"]].tolist() == [2, 2]
    assert found[["iou_photo", "iou_twin", "iou"]].tolist() == pytest.approx([0.75, 0.45, 0.55])
    for name in ("ipd", "ipd_abs"):
        # One view twice in a quarter of the replicates each: -0.2 and 0; both views once in half of them: -0.1.
        expected = [0.3, 0.2, -0.1, -0.2, 0.0]
        assert found[[f"{name}{end}" for end in CHANGE_ENDS]].tolist() == pytest.approx(expected)


def test_only_rocks_in_all_three_domains_are_evaluated():
    more = seen({(ONE, 1): 0.5, (OTHER, 1): 0.4, (ONE, 2): 0.1})
    found = rocks(more, seen({(ONE, 1): 0.5, (OTHER, 1): 0.4, (ONE, 2): 1.0}), TWIN)
    assert found["pairs"] == 2
    assert found["ipd_twin"] == pytest.approx(0)


def test_false_positives_change_by_photo_and_by_area():
    found = rocks(PHOTO, seen({(ONE, 1): 0.5, (OTHER, 1): 0.4}, false_positives=[ONE]), TWIN)
    free = 2 * 31 / 32  # each of the two photos has a rock in one of 32 tiles
    assert found["false_positives_twin"] == pytest.approx(1 / free)
    assert found[["false_positives", "false_positives_photo"]].tolist() == [0, 0]
    assert found["false_positives_change_low"] == pytest.approx(-2 / free)  # its view drawn twice
    assert found["false_positives_change_high"] == 0
    assert found["false_positive_area_change"] == pytest.approx(-40 * 50 / (WIDTH * HEIGHT) / free)


def test_mean_average_precision_changes_with_rocks_that_are_found():
    found = rocks(PHOTO, TWIN, seen({(ONE, 1): 0.7, (OTHER, 1): 0.6}))
    # The only true positive of the twin is ranked first, recall 0.5: precision 1 at 51 of 101 recalls.
    assert found["map50_twin"] == pytest.approx(51 / 101)
    assert found["map50"] == pytest.approx(1)
    assert found["map50_change_high"] == pytest.approx(1)  # the missed view drawn twice


def test_no_change_is_zero_and_the_reverse_change_has_the_opposite_sign():
    options = ComparisonOptions(resamples=100)
    points = [((ONE, OTHER)[number % 2], number + 1) for number in range(5)]
    performances = np.random.default_rng(0).uniform(0.3, 1, (3, 5))
    photo, twin, other = (seen(dict(zip(points, row, strict=True)), [ONE], options=options) for row in performances)
    same = rocks(photo, twin, twin)
    known = [name for name in CHANGES if not np.isnan(same[name])]
    assert len(known) >= len(CHANGE_METRICS)
    assert (same[known] == 0).all()
    there, back = rocks(photo, twin, other), rocks(photo, other, twin)
    for metric in CHANGE_METRICS:
        assert there[f"{metric}_change"] == -back[f"{metric}_change"]
        np.testing.assert_allclose(there[f"{metric}_change_low"], -back[f"{metric}_change_high"], atol=1e-12)


def test_a_class_without_labels_has_a_row_without_metrics():
    found = effect_of(PHOTO, TWIN, TWIN).set_index("kind").loc["shadow"]
    assert found["pairs"] == 0
    assert found[["ipd", "map50", "false_positives"]].isna().all()


def dataset(folder: Path, keys) -> Path:
    tables.write_csv(folder / "pictures.csv", pd.DataFrame({"key": keys, "part": "test"}))
    return folder


def test_the_ablation_has_a_row_per_component_detector_and_class(tmp_path):
    domains = {"analog": PHOTO, "hapke": TWIN, "pose": seen({(ONE, 1): 0.7, (OTHER, 1): 0.4}), "labels": TWIN}
    labels, predictions, datasets = {}, {}, {}
    for name, domain in domains.items():
        columns = [tables.key_columns(PhotoKey.parse(key)) for key in domain.labels["key"]]
        own = pd.concat([pd.DataFrame(columns), domain.labels.drop(columns="key")], axis=1)
        labels[name] = tmp_path / f"{name}_labels.parquet"
        rows = own.assign(source="truth", confidence=1.0).to_dict("records")
        tables.write_parquet(labels[name], tables.label_table(rows))
        datasets[name] = dataset(tmp_path / name, [ONE, OTHER] if name != "pose" else [ONE])
        for trained in ("analog", "hapke"):
            predictions[trained, name] = tmp_path / f"{trained}_on_{name}.parquet"
            tables.write_parquet(predictions[trained, name], domain.predictions.drop(columns="rock"))
    replaced = {"pose": "cameras: truth", "labels": "labels: propagated"}
    write_ablation(
        predictions=predictions, labels=labels, datasets=datasets, photo="analog", twin="hapke", replaced=replaced,
        ablation=tmp_path / "ablation.parquet", size=SIZE, options=OPTIONS, training=TrainingOptions(), imgsz=320,
    )  # fmt: skip
    table = tables.read_parquet(tmp_path / "ablation.parquet", ABLATION_COLUMNS)
    assert list(zip(table["trained"], table["component"], table["kind"], strict=True)) == [
        (trained, component, kind)
        for trained in ("analog", "hapke")
        for component in ("pose", "labels")
        for kind in ("rock", "shadow")
    ]
    assert (table["images"] == 1).all()  # the photo in all data sets
    pose = table[(table["component"] == "pose") & (table["kind"] == "rock")]
    assert pose["ipd_change"].tolist() == pytest.approx([-0.2] * 2)
    assert pose["ipd_change_low"].isna().all()  # a single view has no interval


def test_a_component_describes_its_replacements():
    labels, glare = Component(labels="propagated"), Component(cameras="truth", render={"noise": True, "bounces": 2})
    assert (labels.describe(), labels.is_rendered, labels.needs_truth) == ("labels: propagated", False, False)
    assert (glare.describe(), glare.is_rendered, glare.needs_truth) == (
        "cameras: truth, noise: on, bounces: 2",
        True,
        True,
    )


@pytest.mark.parametrize(
    "components",
    [
        {"pose": {}},
        {"twin": {"labels": "propagated"}},
        {"A pose": {"labels": "propagated"}},
        {"model": {"render": {"models": ["lambert"]}}},
    ],
)
def test_an_impossible_component_is_refused(components):
    with pytest.raises(ValidationError):
        GapOptions(components=components)

"""Tables of the perception on a drive, and metrics over all drives."""

import numpy as np
import pandas as pd
import pytest

from polarsim.rover.perception import detections
from polarsim.rover.perception.measure import measure_drive
from polarsim.rover.perception.summary import metrics, summarise_onboard
from polarsim.schemas.rover import ONBOARD
from tests.rover import driven


@pytest.fixture(scope="module")
def measured(drive):
    return measure_drive(drive[0], driven.vehicle(), drive[1], None, 3)


def test_a_map_from_labels_is_almost_the_true_map_and_fewer_labels_are_visible(measured):
    assert {*measured["map"]["source"]} == {"truth", "visible"}
    truth, visible = (
        {name: table[table["source"] == source] for name, table in measured.items()} for source in ("truth", "visible")
    )
    assert truth["map"]["f1"].min() > 0.85
    assert truth["map"]["within_5_cm"].min() > 0.97
    assert (truth["stops"]["stops"] == 0).all()
    assert truth["sightings"]["detected"].all()
    assert truth["stable"].loc[truth["stable"]["height_m"] > 0.1, "first_stable_m"].max() > 2
    detected = visible["sightings"]["detected"]
    assert len(detected) == len(truth["sightings"])
    assert 0.3 * len(detected) < detected.sum() < len(detected)


def test_metrics_have_intervals_over_rides(drive, measured):
    folder = drive[0]
    summarise_onboard([folder], folder / "figures.parquet")
    summary = pd.read_parquet(folder / "figures.parquet")
    assert summary.dtypes.astype(str).to_dict() == ONBOARD.dtypes
    assert (summary["rides"] <= 2).all()
    recall = summary[summary["metric"] == "recall"].set_index("source")["value"]
    assert (recall["truth"] == 1).all()
    assert recall["visible"].between(0, 1).all()
    known = summary.dropna(subset=["value", "low", "high"])
    assert (known["low"] <= known["value"] + 1e-12).all()
    assert (known["value"] <= known["high"] + 1e-12).all()
    assert {"rock cell F1", "height error m", "false stops per 100 m", "first stable distance m"} <= set(
        summary["metric"]
    )


def test_without_a_minimum_contrast_all_labels_are_visible(drive, monkeypatch):
    monkeypatch.setattr(detections, "MIN_CONTRAST", 0.0)
    options = drive[1].model_copy(update={"suns": ("2",)})
    assert measure_drive(drive[0], driven.vehicle(), options, None, 3)["sightings"]["detected"].all()


def test_exposures_are_separate_and_pooled():
    stops = pd.DataFrame(
        {"seed": 0, "sun": "1", "model": "hapke", "exposure_ms": [256.0, 512.0], "source": "detector", "stops": [1, 3],
         "length_m": 10.0, "miss_5_cm_m": [0.3, np.inf], "miss_10_cm_m": np.inf}
    )  # fmt: skip
    setting = stops[["seed", "sun", "model", "exposure_ms", "source"]]
    parts = {
        "stops": stops,
        "map": setting.assign(cells=10, right=3, false=1, missed=0, f1=1.0, height_error_m=0.01, within_5_cm=1.0),
        "stable": setting.assign(rock=1, height_m=0.2, first_visible_m=3.0, first_stable_m=2.0, stopping_m=0.5),
        "sightings": setting.assign(frame=0, rock=1, distance_m=1.2, height_m=0.2, detected=[True, False]),
    }
    values = metrics(parts).set_index(["metric", "exposure_ms"])["value"]
    np.testing.assert_allclose(values["false stops per 100 m"].sort_index(), [20, 10, 30])  # exposure 0: both
    np.testing.assert_allclose(values.loc["rock cell F1"].iloc[0], 6 / 7)
    assert metrics(parts)[["low", "high"]].isna().all(axis=None)  # a single ride

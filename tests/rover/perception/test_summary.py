"""Metrics of the perception over all drives."""

import numpy as np
import pandas as pd

from polarsim.rover.perception.measure import measure_drive
from polarsim.rover.perception.summary import metrics, summarise_onboard
from polarsim.schemas.rover import ONBOARD
from tests.rover import driven


def test_metrics_have_intervals_over_rides(drive):
    folder, options = drive
    measure_drive(folder, driven.vehicle(), options, None, 3)
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

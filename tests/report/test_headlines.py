"""The five metrics on the first screen of a run: which they are, and their intervals."""

import pandas as pd
import pytest

from polarsim.formats.tables import write_csv
from polarsim.report.headlines import MOST, headlines
from polarsim.scoring.metrics import COLUMNS

DETECTION = ("trained", "evaluated", "kind", "split", "seed", "map50", "map50_low", "map50_high", "unit", "units")


def evaluation(*rows):
    """Stage, terrain, subject, metric, value."""
    shown = [dict(zip(("stage", "terrain", "subject", "metric", "value"), row, strict=True)) for row in rows]
    return pd.DataFrame([{"unit": "1", "n": 1, "against": "truth"} | row for row in shown])[list(COLUMNS)]


@pytest.fixture
def found(tmp_path):
    """`found(name=table, ...)`: headlines of such tables."""

    def make(**tables):
        paths = {name: tmp_path / f"{name}.csv" for name in tables}
        for name, table in tables.items():
            write_csv(paths[name], table)
        return headlines(paths, "real", "polar")

    return make


def test_a_metric_of_terrains_is_the_median_with_the_range(found):
    values = [
        ("labels", terrain, "rock: all but seeds", "f1", value)
        for terrain, value in ((1, 0.9), (3, 0.7), (6, None), (8, 0.8))
    ]
    (one,) = found(evaluation=evaluation(*values))
    assert (one.value, one.interval, one.table) == ("0.800", "0.700 to 0.900", "evaluation")
    assert "range over 3 terrains; against truth" in one.meaning


def test_of_detectors_the_photos_own_and_the_best_of_others_are_shown_with_bootstrapped_intervals(found):
    rows = [("real", 0.5, 0.4, 0.6), ("hapke", 0.2, 0.1, 0.3), ("principled", 0.3, 0.2, 0.4)]
    table = pd.DataFrame(
        [[name, "real", "rock", "view", 0, *score, "view", 8] for name, *score in rows], columns=DETECTION
    )
    own, best = found(detection=table)
    assert own.title.endswith("trained on Real")
    assert (own.value, own.interval) == ("0.50", "0.40 to 0.60")
    assert best.title.endswith("trained on Principled")
    (alone,) = found(detection=table[:1].assign(map50_low=None, map50_high=None))
    assert alone.interval == "no interval: one unit"


def test_there_are_at_most_five_and_none_of_nothing(found):
    stages = [("labels", "rock: all but seeds", "f1"), ("rocks", "paired rocks", "surface_distance_median")]
    stages += [("cameras", "worst position", "position_error_aligned"), ("render", "hapke", "log2_difference")]
    stages += [("cameras", "A (scans, photos)", "median_off_px"), ("rocks", "rock meshes", "watertight_share")]
    assert len(found(evaluation=evaluation(*[(stage, 1, *names, 0.5) for stage, *names in stages]))) == MOST
    assert found() == found(evaluation=evaluation(("labels", 1, "other", "f1", 1.0))) == []

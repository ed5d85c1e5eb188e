"""Headline metrics of a run and their intervals."""

import pandas as pd
import pytest

from polarsim.formats.tables import write_csv
from polarsim.report.headlines import MAX_HEADLINES, headlines
from polarsim.scoring.metrics import COLUMNS

DETECTION = ("trained", "evaluated", "kind", "split", "seed", "map50", "map50_low", "map50_high", "unit", "units")


def evaluation(*rows):
    """Return a table of metrics from rows of stage, terrain, subject, metric and value."""
    shown = [dict(zip(("stage", "terrain", "subject", "metric", "value"), row, strict=True)) for row in rows]
    return pd.DataFrame([{"unit": "1", "n": 1, "against": "truth"} | row for row in shown])[list(COLUMNS)]


@pytest.fixture
def headlines_of(tmp_path):
    """Return a function of named tables that returns the headlines."""

    def make(**tables):
        paths = {name: tmp_path / f"{name}.csv" for name in tables}
        for name, table in tables.items():
            write_csv(paths[name], table)
        return headlines(paths, "real", "files")

    return make


def test_a_metric_of_terrains_is_the_median_with_the_range(headlines_of):
    values = [
        ("labels", terrain, "rock: all but seeds", "f1", value)
        for terrain, value in ((1, 0.9), (3, 0.7), (6, None), (8, 0.8))
    ]
    (headline,) = headlines_of(evaluation=evaluation(*values))
    assert (headline.value, headline.interval, headline.table) == ("0.800", "0.700 to 0.900", "evaluation")
    assert headline.meaning.endswith("3 terrains; against the analog's truth")


def test_a_metric_of_the_run_itself_names_no_reference(headlines_of):
    table = evaluation(("rocks", 1, "rock meshes", "watertight_share", 1.0)).assign(against="own")
    (headline,) = headlines_of(evaluation=table)
    assert headline.meaning.endswith("1 terrain")


def test_the_detector_trained_on_photos_and_the_best_of_the_twins_are_shown_with_intervals(headlines_of):
    rows = [("real", 0.5, 0.4, 0.6), ("hapke", 0.2, 0.1, 0.3), ("principled", 0.3, 0.2, 0.4)]
    table = pd.DataFrame(
        [[name, "real", "rock", "view", 0, *score, "view", 8] for name, *score in rows], columns=DETECTION
    )
    on_photos, on_twins = headlines_of(detection=table)
    assert on_photos.title.endswith("trained on Real")
    assert (on_photos.value, on_photos.interval) == ("0.50", "0.40 to 0.60")
    assert "best of" not in on_photos.meaning
    assert on_twins.title.endswith("trained on Principled")
    assert on_twins.meaning.endswith("best of 2 detectors")
    (single,) = headlines_of(detection=table[:1].assign(map50_low=None, map50_high=None))
    assert single.interval.startswith("no interval")


def test_photos_that_took_part_in_a_fit_are_in_no_headline(headlines_of):
    rows = [("render", 1, f"hapke{relation}", "log2_difference", value)
            for relation, value in ((", in place", 0.1), (", held out", 0.4))]  # fmt: skip
    (headline,) = headlines_of(evaluation=evaluation(*rows))
    assert headline.value == "0.40 stops"
    assert headlines_of(evaluation=evaluation(*rows[:1])) == []


def test_there_are_at_most_five_headlines_and_none_without_metrics(headlines_of):
    stages = [("labels", "rock: all but seeds", "f1"), ("rocks", "paired rocks", "surface_distance_median")]
    stages += [("cameras", "worst position", "position_error_aligned"), ("render", "hapke", "log2_difference")]
    stages += [("cameras", "A (scans, photos)", "median_off_px"), ("rocks", "rock meshes", "watertight_share")]
    assert (
        len(headlines_of(evaluation=evaluation(*[(stage, 1, *names, 0.5) for stage, *names in stages])))
        == MAX_HEADLINES
    )
    assert headlines_of() == headlines_of(evaluation=evaluation(("labels", 1, "other", "f1", 1.0))) == []

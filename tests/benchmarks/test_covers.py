"""The experiment on cover photos as it is configured."""

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def covers():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "benchmarks")  # where `python benchmarks/covers.py` finds what lies beside it
        return importlib.import_module("covers")


def test_every_cover_photo_is_tested_once(covers):
    experiment = covers.read_experiment(ROOT / "config" / "covers.yaml", [])
    tested = sorted(terrain for fold in experiment.folds for terrain in fold)
    assert tested == experiment.terrains
    assert len(set(experiment.keys)) == len(experiment.covers) == 10


def test_every_cover_photo_has_its_published_labels(covers, release_root):
    for key in covers.read_experiment(ROOT / "config" / "covers.yaml", []).covers:
        assert (release_root / "Labels" / f"Terrain{key[:2]}" / f"{key}.txt").is_file()


def test_keys_can_be_changed_from_the_command_line(covers):
    changed = covers.read_experiment(ROOT / "config" / "covers.yaml", ["detect.training.epochs=3", "folds=[[1, 3]]"])
    assert changed.detect.training.epochs == 3
    assert changed.folds == ((1, 3),)


def test_the_drawn_confidence_is_that_of_the_best_f1(covers):
    import pandas as pd

    def table(rows):
        return pd.DataFrame(rows, columns=["key", "x0", "y0", "x1", "y1", "confidence"])

    labels = table([("a", 0, 0, 10, 10, 1), ("a", 20, 0, 30, 10, 1)])
    found = table([("a", 0, 0, 10, 10, 0.9), ("a", 20, 0, 30, 10, 0.6), ("a", 50, 50, 60, 60, 0.5)])
    assert covers.best_confidence(labels, found) == 0.6

"""Figures of a run contain the expected images and data."""

from pathlib import Path

import pytest

from tests.workflow.figures import empty_figures

DEMO = Path(__file__).parents[2] / "results/demo"


@pytest.mark.slow
def test_figures_of_a_small_run_show_pictures_and_data(small):
    # After one epoch no rock is detected, and no Sun is near opposition: these figures contain only a note.
    notes = ["gap_rocks_analog.png", "gap_rocks_hapke.png", "opposition.png"]
    assert empty_figures(small / "results/small") == dict.fromkeys(notes, "note")


@pytest.mark.skipif(not (DEMO / "results.html").exists(), reason="no finished demo is here")
def test_figures_of_a_finished_demo_show_pictures_and_data():
    empty = empty_figures(DEMO)
    assert {name: wrong for name, wrong in empty.items() if not (wrong == "note" and "label_errors" in name)} == {}

"""Figures of a run contain the expected images and data."""

from pathlib import Path

import pytest

from polarsim.report.figures.contact import draw_contact
from polarsim.run_files.pictures import pictures_at
from polarsim.site import polar
from tests.workflow.figures import ALIKE, empty_figures, find_picture

pytestmark = pytest.mark.slow
DEMO = Path(__file__).parents[2] / "results/demo"


def test_figures_of_a_small_run_show_pictures_and_data(small):
    # After one epoch no rock is detected, and no Sun is near opposition: these figures contain only a note.
    notes = ["gap_rocks_analog.png", "gap_rocks_hapke.png", "opposition.png"]
    assert empty_figures(small / "results/small") == dict.fromkeys(notes, "note")


def test_a_contact_sheet_without_photos_is_detected(small, tmp_path):
    results = small / "results/small"
    photos = pictures_at(results / "acquire/Terrain01/photos.parquet")
    labels = results / "labels/tables/Terrain01.parquet"
    keys = [key for key in photos if key.position == "A"]
    draw_contact(site=polar(), keys=keys, labels=labels, pictures=[], figure=tmp_path / "sheet.png")
    assert find_picture(tmp_path / "sheet.png", photos[keys[0]])[0] < 0.6 < ALIKE


@pytest.mark.skipif(not (DEMO / "results.html").exists(), reason="no finished demo is here")
def test_figures_of_a_finished_demo_show_pictures_and_data():
    empty = empty_figures(DEMO)
    assert {name: wrong for name, wrong in empty.items() if not (wrong == "note" and "label_errors" in name)} == {}

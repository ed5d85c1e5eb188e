"""Results page of a run that is not complete."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from polarsim.config import parse_config
from polarsim.formats import png
from polarsim.formats.tables import label_table, write_parquet
from polarsim.paths import RunPaths
from polarsim.photo import PhotoKey
from polarsim.running.first_page import MODIFIED_S, RULE, FirstPage, is_first_page
from polarsim.running.stages import RunProgress
from tests.running.test_stages import FINISHED, PLAN, started
from tests.support.label_rows import label_row
from tests.support.made_workflow import CONFIG

KEY = PhotoKey.parse("02_A_off_30_L_0256")
STAGES = {"scan": "acquire", "mesh": "rocks", RULE: "report"}
WITH_PAGE = PLAN.replace("all  ", f"{RULE}  1\nall  ")


@pytest.fixture
def results(tmp_path, monkeypatch) -> Path:
    """A run in the working folder, without labels and twins; terrain 2 has photos."""
    monkeypatch.chdir(tmp_path)
    folder = Path("results/toy")
    photo = Path(f"data/{KEY}.png")
    png.write_png(photo, np.full((1216, 1936), 508, np.uint16))
    photos = pd.DataFrame({"key": [str(KEY)], "path": [str(photo)]}).astype("str")
    write_parquet(folder / "acquire/Terrain02/photos.parquet", photos)
    return folder


def add_labels_and_twins(results: Path) -> None:
    write_parquet(results / "labels/tables/Terrain02.parquet", label_table([label_row(KEY, box=(500, 400, 900, 700))]))
    png.write_png(results / f"renders/hapke/Terrain02/{KEY}.png", np.full((1216, 1936), 1000, np.uint16))


@pytest.fixture
def page() -> FirstPage:
    return FirstPage(RunPaths(parse_config(yaml.safe_load(CONFIG))))


@pytest.fixture
def progress() -> RunProgress:
    return RunProgress(STAGES, dict.fromkeys(STAGES, 100.0), cores=2, start=0.0)


def updated(page: FirstPage, progress: RunProgress, log: str) -> None:
    """Update progress and page, with the images of a terrain."""
    progress.update(log, 10.0)
    page.update(progress)
    if page._drawing:
        page._drawing.join()
    page.update(progress)


def test_the_page_is_written_when_a_terrain_has_labels_and_twins_and_follows_the_run(results, page, progress):
    log = WITH_PAGE + started(("scan", "02", 1))
    updated(page, progress, log)
    assert not page.page.exists()
    add_labels_and_twins(results)
    updated(page, progress, log)
    text = page.page.read_text()
    assert is_first_page(page.page)
    assert f"Photo {KEY}" in text
    assert text.count("data:image/webp") == 4  # photo, twin, difference, labels
    assert "0 of 2" in text
    assert 'http-equiv="refresh"' in text
    assert re.search(r"running, about \d+ min left", text)
    png.write_png(results / "figures/reflectance.png", np.zeros((4, 4), np.uint8))
    updated(page, progress, log + FINISHED.format(number=1))
    text = page.page.read_text()
    assert "1 of 2" in text
    assert 'href="figures/reflectance.png"' in text
    page.stop(progress)
    text = page.page.read_text()
    assert "incomplete</h1>" in text
    assert "refresh" not in text


def running(output: str) -> str:
    return WITH_PAGE + started(("mesh", "02", 1)).replace("results/toy/mesh/Terrain02", f"results/toy/{output}")


def test_labels_of_a_running_job_are_not_shown(results, page, progress):
    add_labels_and_twins(results)
    log = running("labels/tables/Terrain02.parquet")
    updated(page, progress, log)
    assert not page.page.exists()
    updated(page, progress, log + FINISHED.format(number=1))
    assert is_first_page(page.page)


@pytest.mark.parametrize(
    "other", ["02_A_off_30_L_0032", "02_A_on_30_L_0256", "02_A_off_no_L_0256", ".02_A_off_30_L_0256.1"]
)
def test_the_first_well_exposed_twin_under_the_sun_is_shown_while_others_are_rendered(results, page, progress, other):
    add_labels_and_twins(results)
    twin = results / f"renders/hapke/Terrain02/{KEY}.png"
    only = twin.rename(twin.with_name(f"{other}.png"))
    log = running("renders/hapke/Terrain02")
    updated(page, progress, log)
    assert not page.page.exists()
    shutil.copy(only, twin)
    updated(page, progress, log)
    assert is_first_page(page.page)
    assert f"Photo {KEY}" in page.page.read_text()


def test_only_a_run_that_will_write_the_results_page_has_a_first_page(results, page, progress):
    add_labels_and_twins(results)
    updated(page, progress, PLAN)
    assert not page.page.exists()
    updated(page, progress, WITH_PAGE + started((RULE, "02", 3)))  # the job writes the page
    page.stop(progress)
    assert not page.page.exists()


def test_a_results_page_is_never_replaced(results, page, progress):
    add_labels_and_twins(results)
    page.page.write_text("<!doctype html>\n<html>results")
    updated(page, progress, WITH_PAGE)
    page.stop(progress)
    assert page.page.read_text() == "<!doctype html>\n<html>results"


def test_the_modification_time_is_older_than_all_inputs(results, page, progress):
    """`test_run.py` tests that Snakemake replaces a file of this age."""
    add_labels_and_twins(results)
    updated(page, progress, WITH_PAGE)
    assert page.page.stat().st_mtime == MODIFIED_S


def test_damaged_labels_leave_the_run_without_images(results, page, progress):
    add_labels_and_twins(results)
    (results / "labels/tables/Terrain02.parquet").write_text("")
    updated(page, progress, WITH_PAGE)
    assert not page.page.exists()

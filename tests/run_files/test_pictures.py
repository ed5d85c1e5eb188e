"""Tables of photos are read from any folder, and YOLO data sets survive being packed and moved."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.files import relative_to, resolve_from
from polarsim.formats.tables import write_parquet
from polarsim.photo import PhotoKey
from polarsim.run_files.pictures import picture_finder, pictures_at
from polarsim.run_files.run import Run

KEYS = [PhotoKey.parse(f"01_A_off_30_{camera}_0256") for camera in "LR"]


@pytest.fixture
def clone(tmp_path):
    """A clone with photos, and a run with a table of photo paths relative to the clone."""
    rows = []
    for key in KEYS:
        png.write_png(tmp_path / "clone/data/analog" / f"Cam_{key}.png", np.zeros((2, 3), np.uint16))
        rows.append({"key": str(key), "path": f"data/analog/Cam_{key}.png"})
    write_parquet(tmp_path / "clone/results/demo/acquire/Terrain01/photos.parquet", pd.DataFrame(rows))
    return tmp_path / "clone"


@pytest.mark.parametrize("started_in", [".", "..", "results/demo", "/"])
def test_photos_of_a_run_are_found_from_any_folder(clone, monkeypatch, started_in):
    monkeypatch.chdir(clone / started_in)
    found = Run(clone / "results/demo").pictures_of("photo", 1)
    assert list(found) == KEYS
    assert all(path.is_file() for path in found.values())


def test_photos_of_a_moved_clone_are_found(clone, tmp_path, monkeypatch):
    shutil.move(clone, tmp_path / "moved")
    monkeypatch.chdir("/")
    found = Run(tmp_path / "moved/results/demo").pictures_of("photo", 1)
    assert {path.parent for path in found.values()} == {tmp_path / "moved/data/analog"}


def test_paths_are_unchanged_in_the_folder_of_the_run(clone, monkeypatch):
    monkeypatch.chdir(clone)
    assert Run(Path("results/demo")).pictures_of("photo", 1)[KEYS[0]] == Path(f"data/analog/Cam_{KEYS[0]}.png")


def test_a_missing_or_absolute_path_is_unchanged(tmp_path):
    assert resolve_from("nowhere/x.png", tmp_path / "table.csv") == Path("nowhere/x.png")
    assert resolve_from("/nowhere/x.png", tmp_path / "table.csv") == Path("/nowhere/x.png")


def test_the_nearest_folder_is_preferred(tmp_path):
    for folder in ("", "run"):
        (tmp_path / folder / "meshes").mkdir(parents=True)
    assert resolve_from("meshes", tmp_path / "run/views.yaml") == tmp_path / "run/meshes"
    assert relative_to(tmp_path / "meshes", tmp_path / "run") == "../meshes"


@pytest.mark.parametrize("name", ["nowhere/Terrain01", "nowhere/photos.parquet"])
def test_a_missing_folder_or_table_is_an_error(tmp_path, name):
    with pytest.raises(FormatError, match=str(tmp_path / name)):
        pictures_at(tmp_path / name)
    assert Run(tmp_path).pictures_of("hapke", 1) == {}  # a run without these twins


def test_a_string_instead_of_a_path_is_an_error(clone, monkeypatch):
    monkeypatch.chdir(clone)
    png.write_png(
        clone / f"{KEYS[0]}.png", np.zeros((2, 3), np.uint16)
    )  # would be found in ".", a character of the name
    with pytest.raises(FormatError) as found:
        picture_finder("analog", "results/demo/acquire/Terrain01/photos.parquet")
    assert found.value.path == Path("r")
    with pytest.raises(FormatError):
        pictures_at(".")

import numpy as np
import pytest

from polarsim.errors import ConfigError
from polarsim.formats import png
from polarsim.formats.files import write_text
from polarsim.photo import PhotoKey
from polarsim.run_files.run import PHOTO, Run

KEY = PhotoKey.parse("01_A_off_180_L_0256")


@pytest.fixture
def run(tmp_path):
    for folder in ("hapke", "principled", "maps", "instances"):
        png.write_png(tmp_path / "renders" / folder / "Terrain01" / f"{KEY}.png", np.zeros((2, 3), np.uint16))
    (tmp_path / "renders/principled/Terrain01" / f"{KEY}.png").unlink()
    (tmp_path / "meshes/Terrain01").mkdir(parents=True)
    for name in ("view", "photo"):
        write_text(tmp_path / "detect" / name / "split.csv", "key,part\n")
    return Run(tmp_path)


def test_models_are_the_folders_with_twins(run):
    assert run.models == ("hapke",)
    assert run.domains == (PHOTO, "hapke")
    assert list(run.pictures) == [("hapke", KEY)]
    assert run.domain_of("analog") == PHOTO


def test_terrains_splits_and_tables_are_found_in_the_folder(run):
    assert run.terrains == (1,)
    assert run.splits == ("photo", "view")
    assert run.table("tables/none.parquet") is None
    assert run.all_labels().empty
    assert run.configured("detect") == {}
    write_text(run.folder / "config.yaml", "detect: {splits: [view]}\nrun: demo\n")
    assert run.configured("detect") == {"splits": ["view"]}
    assert run.configured("run") == {}


def test_an_empty_folder_is_an_error(tmp_path):
    with pytest.raises(ConfigError) as error:
        Run.at(tmp_path)
    assert error.value.path == tmp_path

"""Names of exposures and picture sets are read back as they were written, for every exposure that options allow."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.tables import write_parquet
from polarsim.render.options import MODELS
from polarsim.report.figures.drive_images import draw_sequence
from polarsim.rover.cameras.options import SUN_AZIMUTHS_DEG, CameraSuiteOptions
from polarsim.rover.planning.cases import cases, parse_case
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.run_files.picture_sets import PictureSet, exposure_name, exposure_order

EXPOSURES = st.floats(min_value=1e-6, max_value=1e9, exclude_min=True)
SUNS = st.sampled_from([*SUN_AZIMUTHS_DEG, "night"])
MODEL = st.sampled_from(MODELS)


@given(EXPOSURES, EXPOSURES)
def test_names_of_exposures_are_unique_and_sort_and_read_back(one, two):
    names = exposure_name(one), exposure_name(two)
    assert [float(name) for name in names] == [one, two]
    assert all(set(name) <= set("0123456789.") for name in names)  # parts of paths and of Snakemake's wildcards
    assert sorted(names, key=exposure_order) == [exposure_name(each) for each in sorted([one, two])]


def test_whole_exposures_have_four_digits():
    assert [exposure_name(ms) for ms in (1, 256, 256.0, 12.5, 0.5, 1e6, "auto")] == [
        "0001", "0256", "0256", "12.5", "00.5", "1000000", "auto",
    ]  # fmt: skip


@given(SUNS, MODEL, EXPOSURES)
def test_a_picture_set_is_parsed_from_the_name(sun, model, exposure):
    one = PictureSet(sun, model, exposure)
    assert PictureSet.parse(str(one)) == one


@pytest.mark.parametrize("name", ["", "1_hapke", "1_hapke_", "1_hapke_x", "1_hapke_nan", "1_hapke_-1", "__256"])
def test_other_names_are_errors(name):
    with pytest.raises(FormatError):
        PictureSet.parse(name)


@given(st.lists(EXPOSURES, min_size=1, max_size=3, unique=True))
def test_a_drive_is_read_back_from_its_name_in_every_model_and_exposure(exposures):
    cameras = CameraSuiteOptions(exposures_ms=exposures, models=MODELS)
    every = cases(AutonomyOptions(headlights=("off", "on")), cameras, (0,), ["packaged_rover", "principled-seed0"])
    assert [parse_case(case.name) for case in every] == every
    assert {float(case.exposure) for case in every if case.mode == "stereo"} == set(exposures)


@pytest.mark.parametrize(("model", "exposure"), [("hapke", 12.5), ("lunar_lambert", 0.5), ("hapke", 1e6)])
def test_a_drive_is_shown_at_any_exposure_in_any_model(model, exposure, tmp_path):
    pictures = str(PictureSet("night", model, exposure))
    write_parquet(tmp_path / "poses.parquet", pd.DataFrame({"frame": [0], "time_s": [0.0]}))
    png.write_png(tmp_path / pictures / "00000.png", np.full((8, 12), 900, np.uint16))
    draw_sequence(view=tmp_path, pictures=pictures, figure=tmp_path / "figure.png", width=300)
    assert (tmp_path / "figure.png").is_file()

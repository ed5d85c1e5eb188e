"""Figure and tables of drives in which the rover decides: every kind of drive has its place and its name."""

from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from PIL import Image

from polarsim.formats.npz import write_arrays
from polarsim.formats.tables import write_parquet
from polarsim.report.autonomy_table import format_autonomy, format_effects
from polarsim.report.figures import autonomy
from polarsim.report.figures.autonomy import draw_modes, kinds_of, placed
from polarsim.schemas.rover import AUTONOMY, AUTONOMY_EFFECTS

ORIGIN = {"source": "analog"}


def drive(mode, sun="any", exposure="any", lights="any", detector="any", value=1.0, metric="collisions", model=None):
    model = model or ("any" if lights == "any" else "hapke")
    return mode, sun, exposure, lights, model, detector, metric, "", 3, 3, value, value - 0.5, value + 0.5


@pytest.fixture
def table() -> pd.DataFrame:
    found = [drive("blind"), drive("truth")]
    for sun in ("1", "3", "all"):
        exposure = "all" if sun == "all" else "0256"
        found += [drive("stereo", sun, exposure, lit) for lit in ("off", "on")]
        found += [drive("both", sun, exposure, "off", name, value) for name, value in (("a", 1), ("b", 3), ("all", 2))]
    return pd.DataFrame(found, columns=list(AUTONOMY.columns))


def test_a_kind_is_a_mode_with_its_lights_over_all_detectors(table):
    own = kinds_of(table)
    assert list(dict.fromkeys(own["kind"])) == ["truth", "stereo", "stereo, lit", "both", "blind"]
    assert own.groupby("kind")["value"].apply(list)["both"] == [2.0, 2.0]  # a Sun each, over both detectors
    x, edges, labels = placed(own)
    assert labels == ["truth", "stereo", "stereo\nlit", "both", "blind"]
    assert x.is_unique
    for kind, low, high in zip(labels, edges, edges[1:], strict=False):
        rows = x[own["kind"] == kind.replace("\n", ", ")]
        assert rows.between(low, high).all()
        assert rows.mean() == pytest.approx((low + high) / 2)


def test_models_have_kinds_of_their_own_where_there_are_several():
    found = [drive(mode, "1", "0256", "off", model=model) for mode in ("stereo", "both") for model in ("a", "b")][:3]
    own = kinds_of(pd.DataFrame(found, columns=list(AUTONOMY.columns)))
    assert own["kind"].tolist() == ["stereo, a", "stereo, b", "both"]


def test_detectors_that_did_not_all_drive_alike_are_not_averaged():
    """Only b drove with lights on: beside that stands b with lights off, not the mean of a and b."""
    lights = [("off", "a", 1.0), ("off", "b", 3.0), ("off", "all", 2.0), ("on", "b", 4.0), ("on", "all", 4.0)]
    found = [drive("detector", "1", "0256", lit, name, value) for lit, name, value in lights]
    own = kinds_of(pd.DataFrame(found, columns=list(AUTONOMY.columns)))
    assert dict(zip(own["kind"], own["value"], strict=True)) == {"detector": 3.0, "detector, lit": 4.0}


def test_the_figure_is_grey_all_over(table, tmp_path):
    draw_modes(table, tmp_path / "modes.png", ORIGIN, width=400)
    pixels = np.asarray(Image.open(tmp_path / "modes.png").convert("RGB")).astype(int)
    assert np.ptp(pixels, axis=2).max() < 16
    assert (pixels.min(axis=2) < 100).mean() > 0.01  # something is drawn


@pytest.mark.parametrize("exposures", [["0256"], ["0064", "0256"]])
def test_one_exposure_stands_below_the_axis_and_several_in_the_legend(exposures, tmp_path, monkeypatch):
    """A legend of one grey told nothing, and cost the Suns their row."""
    found = [drive("stereo", sun, exposure, "off") for sun in ("1", "3") for exposure in exposures]
    sheet = Figure(layout="constrained")
    monkeypatch.setattr(autonomy, "page", lambda *_: nullcontext(sheet))
    draw_modes(pd.DataFrame(found, columns=list(AUTONOMY.columns)), tmp_path / "modes.png", ORIGIN)
    several = len(exposures) > 1
    below, legend = sheet.axes[-1].get_xlabel(), [text.get_text() for text in sheet.legends[0].get_texts()]
    assert ("256 ms" in below, "256 ms" in legend, len(legend)) == (not several, several, 4 if several else 2)


def test_many_kinds_take_two_columns_of_print(tmp_path):
    found = [
        drive(mode, "1", "0256", lit, model=model)
        for mode in ("detector", "stereo", "both") for lit in ("off", "on") for model in ("hapke", "principled")
    ]  # fmt: skip
    for kinds, width in ((8, 400), (9, 800)):
        draw_modes(
            pd.DataFrame(found[:kinds], columns=list(AUTONOMY.columns)), tmp_path / "modes.png", ORIGIN, width=400
        )
        assert Image.open(tmp_path / "modes.png").size == (width, 580)


def test_what_was_not_measured_is_a_dash_and_intervals_stand_behind_their_value(table):
    row = format_autonomy(table).set_index(["mode", "sun", "detector"]).loc[("both", "1", "b")]
    assert row["collisions"] == "3.00 [2.50, 3.50]"
    assert row["rock map, of 300"] == "–"
    effect = ("both", "sun", "1", "collisions", "", 5, 3.0, 2.5, 3.5, 1.0, np.nan, np.nan)
    shown = format_effects(pd.DataFrame([effect], columns=list(AUTONOMY_EFFECTS.columns)))
    assert shown["collisions"].item() == "3.00 [2.50, 3.50] (+1.00)"


def test_levels_of_the_ground_are_drawn_at_their_nodes(tmp_path):
    write_arrays(tmp_path / "ground.npz", x0_m=-2.0, y0_m=1.0, cell_m=0.5, level_m=np.zeros((3, 5)))
    write_parquet(tmp_path / "rocks.parquet", pd.DataFrame(columns=["x_m", "y_m", "width_m", "height_m"], dtype=float))
    axis = Figure().subplots()
    autonomy._draw_rocks(axis, tmp_path)
    left, right, bottom, top = axis.images[0].get_extent()
    assert [(right - left) / 5, (top - bottom) / 3] == [0.5, 0.5]  # a pixel a node
    assert [left + 0.25, bottom + 0.25] == [-2.0, 1.0]  # at its centre
    assert [*axis.get_xlim(), *axis.get_ylim()] == [-2.0, 0.0, 1.0, 2.0]


def test_exposures_are_in_the_order_of_their_times():
    found = [drive("stereo", "1", exposure, "off") for exposure in ("12.5", "auto", "0256", "1000000")]
    own = kinds_of(pd.DataFrame(found, columns=list(AUTONOMY.columns)))
    x = dict(zip(own["exposure"], placed(own)[0], strict=True))
    assert sorted(x, key=x.__getitem__) == ["12.5", "0256", "1000000", "auto"]

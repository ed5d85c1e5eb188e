"""Figure and tables of autonomous drives."""

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from PIL import Image

from polarsim.formats.files import write_json
from polarsim.formats.npz import write_arrays
from polarsim.formats.tables import write_parquet
from polarsim.report.autonomy_table import format_autonomy, format_effects, format_suns
from polarsim.report.figures import autonomy, autonomy_maps, autonomy_paths
from polarsim.report.figures.autonomy import draw_modes, drive_kinds, mark_positions
from polarsim.report.figures.autonomy_maps import draw_autonomy_maps, mode_and_pose
from polarsim.schemas.rover import AUTONOMY, AUTONOMY_EFFECTS, AUTONOMY_EVENTS

ORIGIN = {"source": "analog"}


def drive(
    mode,
    sun="any",
    exposure="any",
    lights="any",
    detector="any",
    value=1.0,
    metric="collisions",
    model=None,
    pose="truth",
):
    model = model or ("any" if lights == "any" else "hapke")
    return mode, sun, exposure, lights, model, detector, pose, metric, "", 3, 3, value, value - 0.5, value + 0.5


@pytest.fixture
def table() -> pd.DataFrame:
    rows = [drive("blind"), drive("truth")]
    for sun in ("1", "3", "all"):
        exposure = "all" if sun == "all" else "0256"
        rows += [drive("stereo", sun, exposure, lit) for lit in ("off", "on")]
        rows += [drive("both", sun, exposure, "off", name, value) for name, value in (("a", 1), ("b", 3), ("all", 2))]
    return pd.DataFrame(rows, columns=list(AUTONOMY.columns))


def test_a_kind_is_a_mode_with_its_lights_over_all_detectors(table):
    kinds = drive_kinds(table)
    assert list(dict.fromkeys(kinds["kind"])) == ["truth", "stereo", "stereo, lit", "both", "blind"]
    assert kinds.groupby("kind")["value"].apply(list)["both"] == [2.0, 2.0]  # per Sun, mean over both detectors
    x, edges, labels = mark_positions(kinds)
    assert labels == ["truth", "stereo", "stereo\nlit", "both", "blind"]
    assert x.is_unique
    for kind, low, high in zip(labels, edges, edges[1:], strict=False):
        rows = x[kinds["kind"] == kind.replace("\n", ", ")]
        assert rows.between(low, high).all()
        assert rows.mean() == pytest.approx((low + high) / 2)


def test_a_pose_that_is_not_known_is_a_kind_of_its_own_and_a_row():
    rows = [drive("stereo", "1", "0256", "off", pose=pose) for pose in ("truth", "fused")]
    table = pd.DataFrame(rows, columns=list(AUTONOMY.columns))
    assert drive_kinds(table)["kind"].tolist() == ["stereo", "stereo, fused pose"]
    assert format_autonomy(table)["mode"].tolist() == ["stereo", "stereo, fused pose"]


def test_a_kind_does_not_name_lights_and_model_that_have_no_effect():
    """Drives by labels with a known pose render no images for the rover; those with an estimated pose do."""
    rows = [drive("truth"), *(drive("truth", sun, "0256", "off", pose="fused") for sun in ("1", "3"))]
    kinds = drive_kinds(pd.DataFrame(rows, columns=list(AUTONOMY.columns)))
    assert kinds["kind"].tolist() == ["truth", "truth, fused pose", "truth, fused pose"]
    rows += [drive("truth", "1", "0256", "on", pose="fused", model=model) for model in ("hapke", "principled")]
    kinds = drive_kinds(pd.DataFrame(rows, columns=list(AUTONOMY.columns)))
    assert set(kinds["kind"]) == {
        "truth", "truth, fused pose, hapke", "truth, fused pose, lit, hapke", "truth, fused pose, lit, principled"
    }  # fmt: skip


def test_a_mode_with_several_models_has_a_kind_per_model():
    rows = [drive(mode, "1", "0256", "off", model=model) for mode in ("stereo", "both") for model in ("a", "b")][:3]
    kinds = drive_kinds(pd.DataFrame(rows, columns=list(AUTONOMY.columns)))
    assert kinds["kind"].tolist() == ["stereo, a", "stereo, b", "both"]


def test_detectors_with_drives_in_different_conditions_are_not_averaged():
    """Only detector b has drives with lights on, so b with lights off is shown, not the mean of a and b."""
    lights = [("off", "a", 1.0), ("off", "b", 3.0), ("off", "all", 2.0), ("on", "b", 4.0), ("on", "all", 4.0)]
    rows = [drive("detector", "1", "0256", lit, name, value) for lit, name, value in lights]
    kinds = drive_kinds(pd.DataFrame(rows, columns=list(AUTONOMY.columns)))
    assert dict(zip(kinds["kind"], kinds["value"], strict=True)) == {"detector": 3.0, "detector, lit": 4.0}


def test_the_figure_is_grey(table, tmp_path):
    draw_modes(table, tmp_path / "modes.png", ORIGIN, width=400)
    pixels = np.asarray(Image.open(tmp_path / "modes.png").convert("RGB")).astype(int)
    assert np.ptp(pixels, axis=2).max() < 16
    assert (pixels.min(axis=2) < 100).mean() > 0.01


@pytest.mark.parametrize("exposures", [["0256"], ["0064", "0256"]])
def test_a_single_exposure_is_written_below_the_axis_and_several_in_the_legend(exposures, tmp_path, monkeypatch):
    rows = [drive("stereo", sun, exposure, "off") for sun in ("1", "3") for exposure in exposures]
    sheet = Figure(layout="constrained")
    monkeypatch.setattr(autonomy, "page", lambda *_: nullcontext(sheet))
    draw_modes(pd.DataFrame(rows, columns=list(AUTONOMY.columns)), tmp_path / "modes.png", ORIGIN)
    several = len(exposures) > 1
    below, legend = sheet.axes[-1].get_xlabel(), [text.get_text() for text in sheet.legends[0].get_texts()]
    assert ("256 ms" in below, "256 ms" in legend, len(legend)) == (not several, several, 4 if several else 2)


def test_many_kinds_need_two_printed_columns(tmp_path):
    rows = [
        drive(mode, "1", "0256", lit, model=model)
        for mode in ("detector", "stereo", "both") for lit in ("off", "on") for model in ("hapke", "principled")
    ]  # fmt: skip
    for kinds, width in ((8, 400), (9, 800)):
        draw_modes(
            pd.DataFrame(rows[:kinds], columns=list(AUTONOMY.columns)), tmp_path / "modes.png", ORIGIN, width=400
        )
        assert Image.open(tmp_path / "modes.png").size == (width, 580)


def test_missing_metrics_are_dashes_and_intervals_follow_the_value(table):
    row = format_autonomy(table).set_index(["mode", "sun", "detector"]).loc[("both", "1", "b")]
    assert row["collisions"] == "3.00 [2.50, 3.50]"
    assert row["rock map, of 300"] == "–"
    effect = ("both", "truth", "sun", "1", "collisions", "", 5, 3.0, 2.5, 3.5, 1.0, np.nan, np.nan, 2.0, 1.0, 2.0)
    shown = format_effects(pd.DataFrame([effect], columns=list(AUTONOMY_EFFECTS.columns)))
    assert shown["collisions"].item() == "3.00 [2.50, 3.50] (+1.00)"


def test_collisions_are_listed_by_part_and_metrics_without_values_have_no_column():
    parts = {"": 1.5, " of wheels": 1.0, " of legs": 0.5, " of the body": 0.0}
    rows = [drive("blind", value=value, metric=f"collisions{part}") for part, value in parts.items()]
    shown = format_autonomy(pd.DataFrame(rows, columns=list(AUTONOMY.columns)))
    assert shown["by wheels, legs, body"].item() == "1.00, 0.50, 0.00"
    assert not {"position error, % of path", "stereo motions lost, rejected"} & set(shown)


def test_lost_and_rejected_stereo_motions_are_listed_for_drives_with_a_stereo_pair():
    metrics = {"stereo motions lost": 2.5, "stereo motions rejected": 0.0}
    rows = [drive("stereo", "1", "0256", "off", value=v, metric=name, pose="fused") for name, v in metrics.items()]
    shown = format_autonomy(pd.DataFrame([drive("blind"), *rows], columns=list(AUTONOMY.columns)))
    assert shown["stereo motions lost, rejected"].tolist() == ["–", "2.50, 0.00"]


def test_suns_are_listed_from_best_to_worst_for_each_source_of_the_pose():
    rows = [
        ("stereo", pose, "sun", sun, "points", "points of 1000", 2, 700.0, *[np.nan] * 5, rank, low, high)
        for pose, ranks in (("truth", {"1": 1.0, "3": 2.0}), ("fused", {"1": 2.0, "3": 1.0}))
        for sun, rank, low, high in ((sun, rank, 1.0, 2.0) for sun, rank in ranks.items())
    ]
    shown = format_suns(pd.DataFrame(rows, columns=list(AUTONOMY_EFFECTS.columns)).astype({"rank": float}))
    assert dict(zip(shown["mode"], shown["points"], strict=True)) == {
        "stereo": "1 (1 [1, 2]), 3 (2 [1, 2])", "stereo, fused pose": "3 (1 [1, 2]), 1 (2 [1, 2])",
    }  # fmt: skip


def test_pixels_of_the_ground_are_centred_on_grid_nodes(tmp_path):
    write_arrays(tmp_path / "ground.npz", x0_m=-2.0, y0_m=1.0, cell_m=0.5, level_m=np.zeros((3, 5)))
    write_parquet(tmp_path / "rocks.parquet", pd.DataFrame(columns=["x_m", "y_m", "width_m", "height_m"], dtype=float))
    axis = Figure().subplots()
    autonomy_paths._draw_rocks(axis, tmp_path)
    left, right, bottom, top = axis.images[0].get_extent()
    assert [(right - left) / 5, (top - bottom) / 3] == [0.5, 0.5]  # one pixel per node
    assert [left + 0.25, bottom + 0.25] == [-2.0, 1.0]  # centre of the first pixel
    assert [*axis.get_xlim(), *axis.get_ylim()] == [-2.0, 0.0, 1.0, 2.0]


def test_exposures_are_sorted_by_time():
    rows = [drive("stereo", "1", exposure, "off") for exposure in ("12.5", "auto", "0256", "1000000")]
    kinds = drive_kinds(pd.DataFrame(rows, columns=list(AUTONOMY.columns)))
    x = dict(zip(kinds["exposure"], mark_positions(kinds)[0], strict=True))
    assert sorted(x, key=x.__getitem__) == ["12.5", "0256", "1000000", "auto"]


def write_case(folder: Path, estimate: bool) -> Path:
    """Write the files of a drive from (3, 0) to (-3, 0) m that figures read; the estimate drifts to the north."""
    write_arrays(folder / "world/ground.npz", x0_m=-4.0, y0_m=-2.0, cell_m=0.1, level_m=np.zeros((41, 81)))
    rocks = pd.DataFrame([(1.0, 0.6, 0.3, 0.2), (-1.0, -0.7, 0.2, 0.05)], columns=["x_m", "y_m", "width_m", "height_m"])
    write_parquet(folder / "world/rocks.parquet", rocks)
    x, y = np.arange(-4, 4, 0.15), np.arange(-2, 2, 0.15)
    cells = np.zeros((len(y), len(x)))
    write_arrays(folder / "map.npz", x_m=x, y_m=y, log_odds=cells, seen=cells > -1, hazard=cells > 0)
    path = pd.DataFrame({"time_s": np.linspace(0, 30, 61), "x_m": np.linspace(3, -3, 61), "y_m": 0.0, "z_m": 0.0})
    write_parquet(folder / "trace.parquet", path)
    write_parquet(folder / "events.parquet", pd.DataFrame(columns=list(AUTONOMY_EVENTS.columns)))
    write_json(folder / "drive.json", {"ended": "finished", "seconds": 30.0})
    (folder / "pictures").mkdir()
    if estimate:
        write_parquet(folder / "localisation/estimate.parquet", path.assign(y_m=np.linspace(0, 0.5, 61)))
    return folder


def test_estimated_paths_are_drawn_with_a_key_and_each_source_of_the_pose_has_a_map(tmp_path, monkeypatch):
    names = ("truth_seed0", "stereo_1_0256_off_hapke_seed0", "stereo_fused_1_0256_off_hapke_seed0")
    folders = [write_case(tmp_path / name, "fused" in name) for name in names]
    assert [mode_and_pose(folder) for folder in folders] == [
        ("truth", "truth"),
        ("stereo", "truth"),
        ("stereo", "fused"),
    ]
    sheets = []
    for module in (autonomy_paths, autonomy_maps):
        monkeypatch.setattr(module, "page", lambda *_: nullcontext(sheets[-1]))
    sheets.append(Figure(layout="constrained"))
    autonomy_paths.draw_paths(folders=folders, figure=tmp_path / "ways.png", origin=ORIGIN)
    paths, errors = sheets[-1].axes
    dashed = [line for line in paths.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[-1] for line in dashed] == [0.5]
    (error,) = errors.lines
    np.testing.assert_allclose(error.get_xdata(), np.arange(7) + 0.5)  # m driven; the end is the start of a metre
    at = np.minimum(np.arange(7) + 0.9, 6)  # last pose of each metre
    np.testing.assert_allclose(error.get_ydata(), 500 * at / 6)  # mm
    assert error.get_marker() == "o"  # Sun 1
    key = "path as estimated by the rover"
    assert key in [text.get_text() for text in sheets[-1].legends[0].get_texts()]
    sheets.append(Figure(layout="constrained"))
    draw_autonomy_maps(folders=folders, figure=tmp_path / "maps.png", origin=ORIGIN)
    titles = [axis.get_title() for axis in sheets[-1].axes if axis.get_title()]
    assert [title.split(":")[0] for title in titles] == [
        "truth", "stereo, Sun 1, 256 ms", "stereo, fused pose, Sun 1, 256 ms",
    ]  # fmt: skip
    assert key in [text.get_text() for text in sheets[-1].legends[0].get_texts()]
    sheets.append(Figure(layout="constrained"))
    autonomy_paths.draw_paths(folders=folders[:2], figure=tmp_path / "known.png", origin=ORIGIN)
    assert len(sheets[-1].axes) == 1  # without estimates there are no errors


def test_paths_with_and_without_lights_have_different_marks(tmp_path, monkeypatch):
    names = ("stereo_fused_1_0256_off_hapke_seed0", "stereo_fused_1_0256_on_hapke_seed0")
    folders = [write_case(tmp_path / name, True) for name in names]
    sheet = Figure(layout="constrained")
    monkeypatch.setattr(autonomy_paths, "page", lambda *_: nullcontext(sheet))
    autonomy_paths.draw_paths(folders=folders, figure=tmp_path / "ways.png", origin=ORIGIN)
    for axes in sheet.axes:
        unlit, lit = (line for line in axes.lines if line.get_marker() == "o")
        assert unlit.get_markerfacecolor() == lit.get_color() != lit.get_markerfacecolor()
    texts = [text.get_text() for text in sheet.legends[0].get_texts()]
    assert "lights on" in texts

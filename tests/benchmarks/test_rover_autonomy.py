"""Drives of other machines, as the benchmark of autonomy takes them over."""

import runpy
import sys

import pandas as pd
import pytest

from benchmarks import rover_autonomy
from benchmarks.rover_autonomy import made_with, row_of, take_over, write_rows
from polarsim.formats import tables
from polarsim.rover.planning.cases import Case
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.schemas import EVERY_AUTONOMY


def test_rows_of_drives_come_back_as_their_figures(tmp_path):
    detecting = Case("detector", 3, "1", "0064", "off", "hapke", "analog-seed0")
    cases = {detecting: [("collisions", "", 2.0), ("rock map", "points of 300", 64.28)], Case("blind", 3): []}
    files = []
    for case, metrics in cases.items():
        named = {**case.axes, "seed": case.seed, "ended": "finished"}
        rows = [{**named, "metric": name, "unit": unit, "value": value} for name, unit, value in metrics]
        rows.append({**named, "metric": "path", "unit": "m", "value": 9.5})
        files.append(tmp_path / "made" / case.name / "figures.parquet")
        files[-1].parent.mkdir(parents=True)
        tables.write_parquet(files[-1], pd.DataFrame(rows, columns=list(EVERY_AUTONOMY.columns)))
    made = made_with([4], AutonomyOptions())
    assert made == made_with([4], AutonomyOptions(seeds=(3,), suns=("1",)))
    write_rows(files, tmp_path / "drives.csv", made)
    take_over(tmp_path / "drives.csv", tmp_path / "taken", made)
    for file in files:
        taken = tables.read_parquet(tmp_path / "taken" / file.relative_to(tmp_path / "made"), EVERY_AUTONOMY.columns)
        own = tables.read_parquet(file, EVERY_AUTONOMY.columns)
        pd.testing.assert_frame_equal(*(each.sort_values("metric", ignore_index=True) for each in (own, taken)))


def test_a_drive_that_was_near_no_rock_has_a_line_too():
    own = pd.DataFrame(
        [("finished", "time", 9.0), ("finished", "collisions", 0.0), ("finished", "CPU for a second driven", 0.5)],
        columns=["ended", "metric", "value"],
    )
    assert "closest nan m" in row_of(Case("blind", 3), own)


def test_drives_with_other_options_are_not_taken_over(tmp_path):
    """Drives whose pictures had no noise would have stood beside those with it."""
    noisy, clean = (made_with([4], AutonomyOptions(noise=noise)) for noise in (True, False))
    rows = pd.DataFrame([{**Case("blind", 3).axes, "seed": 3, "ended": "finished", "path [m]": 9.5}])
    for number, found in enumerate((rows, rows.assign(options=clean))):
        rows_file = tmp_path / f"{number}.csv"
        found.to_csv(rows_file, index=False)
        with pytest.raises(SystemExit, match="other options or terrains"):
            take_over(rows_file, tmp_path / "taken", noisy)
    assert not (tmp_path / "taken").exists()


def test_meshes_that_are_not_there_are_one_line(tmp_path, monkeypatch, capfd):
    asked = [str(tmp_path / "meshes"), str(tmp_path / "out"), "--terrains=4", "--modes=truth", "--seeds=1"]
    monkeypatch.setattr(sys, "argv", ["rover_autonomy.py", *asked])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(rover_autonomy.__file__, run_name="__main__")
    assert ended.value.code == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f"error: {tmp_path / 'meshes'}")
    assert not (tmp_path / "out").exists()

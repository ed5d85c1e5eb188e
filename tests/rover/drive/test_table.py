"""Metrics of drives, with intervals over seeds."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from polarsim.rover.drive.table import drive_table, wheel_metrics
from polarsim.rover.drive.trace import COLUMNS, GROUND, LevelChanges, Trace, trace_table
from polarsim.rover.world.surface import bare_world
from polarsim.schemas.rover import DRIVES


def trace(seed: int, offset: float, control: str = "heading") -> Trace:
    """Four rows in motion: slip 0.1 of the left front wheel on soil, and 0.9 in a row on a rock."""
    rows = np.zeros((4, len(COLUMNS)))
    rows[:, COLUMNS.index("command_speed_m_s")] = 0.2
    rows[:, COLUMNS.index("offset_m")] = offset
    rows[:, [COLUMNS.index(f"{wheel}_contact") for wheel in ("lf", "rf", "lr", "rr")]] = 1
    rows[2, COLUMNS.index("lf_contact")] = 2
    rows[:, COLUMNS.index("lf_slip")] = [0.1, 0.1, 0.9, 0.1]
    rows[:, COLUMNS.index("rr_torque_n_m")] = [4, 6, 4, 6]
    drive = {
        "seed": seed, "ended": "finished", "seconds": 5.0, "along_m": 2.0, "energy_open": -0.001,
        "options": {"drive": {"control": control}},
        "contacts": [
            {"rock": rock, "part": part, "link": link, "time_s": 1.0, "duration_s": 0.1, "impulse_n_s": 2.0}
            for rock, part, link in (
                (0, "tread", "lf_wheel"), (0, "flank", "lf_wheel"), (0, "body", "base_link"), (1, "leg", "rr_arm"),
                (2, "tread", "lf_wheel"), (GROUND, "body", "base_link"),
            )
        ],
        "energy_j": {"motor": 40.0, "motor_of": {"lf": 10.0, "rf": 10.0, "lr": 10.0, "rr": 10.0}},
    }  # fmt: skip
    tracks = LevelChanges(np.zeros(0), np.zeros(1, int), np.zeros(0, np.int32), np.zeros(0, np.float32))
    world = bare_world(np.zeros((2, 2)), 1.0, 0.0, 0.0)
    rocks = pd.DataFrame({"rock": [0, 1, 2], "height_m": [0.3, 0.2, 0.05], "x_m": 0.0, "y_m": 0.0})
    return Trace(trace_table(rows), replace(world, rocks=rocks), tracks, drive)


def value(table, metric: str, wheel: str = "all", column: str = "value") -> float:
    return float(table[(table["metric"] == metric) & (table["wheel"] == wheel)][column].iloc[0])


def test_slip_is_averaged_on_soil_and_time_on_rocks_over_any_wheel():
    metrics = wheel_metrics(trace(0, 0.01))
    assert value(metrics, "slip", "lf") == pytest.approx(0.1)
    assert value(metrics, "time on a rock", "lf") == 25
    assert value(metrics, "time on a rock", "rr") == 0
    assert value(metrics, "time on a rock") == 25
    assert value(metrics, "rocks above 10 cm touched") == 2
    assert value(metrics, "rocks above 10 cm touched", "lf") == 1
    assert value(metrics, "rocks above 10 cm touched by legs or body") == 2
    assert value(metrics, "torque", "rr") == 5
    assert value(metrics, "energy") == 20
    assert value(metrics, "energy", "lr") == 5
    assert value(metrics, "offset, RMS") == pytest.approx(10)


def test_each_control_law_has_rows():
    table = drive_table([trace(0, 0.01), trace(1, 0.03), trace(0, 0.08, "P-only")])
    assert table.dtypes.astype(str).to_dict() == DRIVES.dtypes
    for control, mean, seeds in (("heading", 20, 2), ("P-only", 80, 1)):
        part = table[table["control"] == control]
        assert value(part, "offset, RMS", column="mean") == pytest.approx(mean)
        assert value(part, "offset, RMS", column="seeds") == seeds


def test_no_drive_gives_an_empty_table():
    assert tuple(drive_table([]).columns) == DRIVES.columns

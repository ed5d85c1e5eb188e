"""Metrics of drives: slip, sinkage, torque, energy, offset, time on rocks and touched rocks, with intervals over seeds.

The interval of a mean over n seeds is Student's, mean +- t(0.975, n - 1) s / sqrt(n). It is undefined for n = 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.intervals import student_interval
from polarsim.rover.drive.trace import Trace, read_trace, rock_contacts
from polarsim.rover.vehicle.table import WHEELS
from polarsim.schemas.rover import DRIVE_METRICS, DRIVES, HIGH_M

WHOLE = "all"  # value of `wheel` for metrics of the rover
TREAD_AND_FLANK = ("tread", "flank")  # parts of wheels in contacts
MIN_SPEED_M_S = 0.02  # m/s: rows at lower speed are excluded from slip


def summarise_drives(folders: Sequence[Path], each: Path, together: Path) -> None:
    """Write a row per drive and metric, `DRIVE_METRICS.columns`, and the summary `drive_table`."""
    traces = [read_trace(folder) for folder in folders]
    parts = [rover_metrics(trace) for trace in traces]
    tables.write_parquet(each, pd.concat(parts, ignore_index=True))
    tables.write_parquet(together, drive_table(traces))


def rover_metrics(trace: Trace) -> pd.DataFrame:
    """Return the metrics of the rover in a drive, `DRIVE_METRICS.columns`."""
    metrics = wheel_metrics(trace)
    header = trace.drive
    columns = {"seed": int(header["seed"]), "control": header["options"]["drive"]["control"], "ended": header["ended"]}
    return metrics[metrics["wheel"] == WHOLE].assign(**columns)[list(DRIVE_METRICS.columns)].reset_index(drop=True)


def wheel_metrics(trace: Trace) -> pd.DataFrame:
    """Return the metrics of a drive, a row per metric and wheel: `metric`, `wheel`, `unit`, `value`.

    Means are over logged rows in motion. Slip, sinkage and torque exclude rows in which the wheel touches a rock, where
    they have another meaning.
    """
    table = trace.table
    speed = np.hypot(table["vx_m_s"], table["vy_m_s"])
    moving = table[(speed > MIN_SPEED_M_S) | (table["command_speed_m_s"].abs() > MIN_SPEED_M_S)]
    account, driven = trace.drive["energy_j"], max(float(trace.drive["along_m"]), 1e-9)
    hit = rock_contacts(trace)
    hit = hit[hit["height_m"] > HIGH_M]
    rows: list[tuple[str, str, str, float]] = []
    on_rock = np.zeros(len(moving), bool)
    for wheel in WHEELS:
        contact = moving[f"{wheel}_contact"]
        soil, rock = moving[contact == "soil"], contact.isin(["rock", "both"]).to_numpy()
        on_rock |= rock
        rows += [
            ("slip", wheel, "", soil[f"{wheel}_slip"].mean()),
            ("sinkage", wheel, "mm", 1000 * soil[f"{wheel}_sinkage_first_m"].mean()),
            ("sinkage, 95th percentile", wheel, "mm", 1000 * float(soil[f"{wheel}_sinkage_first_m"].quantile(0.95))),
            ("torque", wheel, "N m", soil[f"{wheel}_torque_n_m"].mean()),
            ("energy", wheel, "J/m", account["motor_of"][wheel] / driven),
            ("time on a rock", wheel, "%", 100 * float(rock.mean()) if len(rock) else 0.0),
            ("rocks above 10 cm touched", wheel, "", float(hit["rock"][hit["link"] == f"{wheel}_wheel"].nunique())),
        ]
    for metric in ("slip", "sinkage", "torque"):
        values = [(unit, value) for name, _, unit, value in rows if name == metric]
        rows.append((metric, WHOLE, values[0][0], float(np.nanmean([value for _, value in values]))))
    offset = table["offset_m"].to_numpy()
    rows += [
        ("energy", WHOLE, "J/m", account["motor"] / driven),
        ("time on a rock", WHOLE, "%", 100 * float(on_rock.mean()) if len(on_rock) else 0.0),
        ("rocks above 10 cm touched", WHOLE, "", float(hit["rock"].nunique())),
        (
            "rocks above 10 cm touched by legs or body",
            WHOLE,
            "",
            float(hit["rock"][~hit["part"].isin(TREAD_AND_FLANK)].nunique()),
        ),
        ("offset, RMS", WHOLE, "mm", 1000 * math.sqrt(float((offset**2).mean()))),
        ("offset, largest", WHOLE, "mm", 1000 * float(np.abs(offset).max())),
        ("energy missing", WHOLE, "%", 100 * abs(float(trace.drive["energy_open"]))),
        ("duration", WHOLE, "s", float(trace.drive["seconds"])),
        ("reached the end", WHOLE, "%", 100.0 * (trace.drive["ended"] == "finished")),
    ]
    return pd.DataFrame(rows, columns=["metric", "wheel", "unit", "value"])


def drive_table(traces: Iterable[Trace]) -> pd.DataFrame:
    """Return `DRIVES.columns`, a row per control law (`heading`, `P-only`), metric and wheel.

    Values are the mean over seeds, the 95 % interval, the minimum and the maximum.
    """
    parts = [wheel_metrics(trace).assign(control=trace.drive["options"]["drive"]["control"]) for trace in traces]
    if not parts:
        return pd.DataFrame(columns=list(DRIVES.columns))
    rows = []
    for key, group in pd.concat(parts).groupby(["control", "metric", "wheel", "unit"], sort=False):
        values = group["value"][np.isfinite(group["value"])]
        interval = student_interval(values.to_numpy())
        rows.append((*key, len(values), values.mean(), *interval, values.min(), values.max()))
    return pd.DataFrame(rows, columns=list(DRIVES.columns))

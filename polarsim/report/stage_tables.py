"""Tables of single stages that papers quote: cameras, alignment of scans and labels, rocks, meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_csv, read_parquet
from polarsim.geometry.poses import yaw_pitch_roll
from polarsim.photo import CAMERAS
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.schemas import report
from polarsim.schemas.table import Table
from polarsim.scoring.metrics import COLUMNS as METRIC_COLUMNS

CAMERA_METRICS = ("sd_mm", "sd_deg", "off_survey_m", "off_survey_deg", "median_off_before_px", "median_off_px")
CAMERA_ERRORS = {"position_error_aligned": "error_mm", "angle_error_aligned": "error_deg"}
REPROJECTIONS = ("reprojection", "rock_reprojection")
ALIGNMENT_FILE = "alignment.csv"  # of the cameras stage
LABEL_METRICS = ("matched", "mean_iou", "median_dx_px", "median_dy_px")

CAMERA_CAPTION = (
    "Left cameras: position and heading in the sandbox, formal standard deviations, distance from the survey; how far "
    "photos lie from the shaded meshes before and after the refinement; errors against truth after one rigid alignment "
    "of the terrain's cameras. True rocks in photos: after that alignment, and with meshes laid on the true surface."
)
ALIGNMENT_CAPTION = (
    "How scans lie on each other, and how projected meshes lie on the boxes that cameras were fitted to."
)
ROCK_CAPTION = (
    "Every rock: where it lies, its size above the ground (table meshes tells what that was made from), and by which "
    "positions' labels it is confirmed."
)
MESH_CAPTION = (
    "Every mesh: what it was made from (a fitted ground is a smooth guess from the rocks' feet, without craters and "
    "mounds), soundness, contact with the ground, its thinned copy, and its distance from the visible true surface."
)


def tabulate_cameras(
    *, cameras: Mapping[int, Path], evaluation: Sequence[Path], table: Path, alignment: Path, origin: Mapping[str, str]
) -> None:
    """Write the tables of cameras and of alignment, from the terrains' camera folders and their metric files.

    `table` and `alignment` are stems: four forms each.
    """
    localised = {terrain: read_all_localised(folder) for terrain, folder in sorted(cameras.items())}
    metrics = pd.concat([read_csv(path, METRIC_COLUMNS) for path in evaluation], ignore_index=True)
    rows = [
        _camera_row(terrain, *item, metrics) for terrain, rigs in localised.items() for item in sorted(rigs.items())
    ]
    _write(table, rows, report.CAMERAS, CAMERA_CAPTION, origin)
    rows = [row for terrain, folder in sorted(cameras.items()) for row in _alignment_rows(terrain, folder)]
    _write(alignment, rows, report.ALIGNMENT, ALIGNMENT_CAPTION, origin)


def tabulate_rocks(
    *, rocks: Mapping[int, Path], scores: Mapping[int, Path], table: Path, meshes: Path, origin: Mapping[str, str]
) -> None:
    """Write the tables of rocks and of meshes, from the terrains' rocks.parquet and mesh scores.

    `table` and `meshes` are stems: four forms each.
    """
    for stem, caption, parts in (
        (table, ROCK_CAPTION, {terrain: _rocks(path) for terrain, path in rocks.items()}),
        (meshes, MESH_CAPTION, {terrain: read_csv(path, ["mesh"]) for terrain, path in scores.items()}),
    ):
        whole = pd.concat([part.assign(terrain=terrain) for terrain, part in sorted(parts.items())], ignore_index=True)
        whole = whole[["terrain", *(name for name in whole.columns if name != "terrain")]]
        _write_frame(stem, whole, caption, origin)


def _rocks(path: Path) -> pd.DataFrame:
    """A terrain's rocks; `source` is the run's in every table, so what found a rock is `found_by`."""
    return read_parquet(path, ["rock", "source"]).rename(columns={"source": "found_by"})


def _camera_row(terrain: int, position: str, rig: LocalisedRig, metrics: pd.DataFrame) -> dict[str, Any]:
    x, y, z = rig.sandbox_from_left.translation
    angles = np.degrees(yaw_pitch_roll(rig.sandbox_from_left))
    mine = metrics[
        (metrics["terrain"] == terrain) & metrics["subject"].isin([position, f"{position} L", f"{position} R"])
    ]
    value = {(row.subject, row.metric): row.value for row in mine.itertuples()}
    return {
        "terrain": terrain, "position": position, "method": rig.method, "x_m": x, "y_m": y, "z_m": z,
        **dict(zip(("yaw_deg", "pitch_deg", "roll_deg"), angles, strict=True)),
        **{name: rig.metrics.get(name, np.nan) for name in CAMERA_METRICS},
        **{column: value.get((position, metric), np.nan) for metric, column in CAMERA_ERRORS.items()},
        **{
            f"{name}_{camera.lower()}_px": value.get((f"{position} {camera}", f"{name}_median"), np.nan)
            for name in REPROJECTIONS
            for camera in CAMERAS
        },
    }  # fmt: skip


def _alignment_rows(terrain: int, folder: Path) -> list[dict[str, Any]]:
    """Pairs of scans where there are scans, else positions and their boxes."""
    scans = folder / ALIGNMENT_FILE
    if scans.exists():
        pairs = read_csv(scans).rename(columns={"pair": "between"}).assign(terrain=terrain, evidence="scans")
        return [dict(zip(map(str, pairs.columns), row, strict=True)) for row in pairs.itertuples(index=False)]
    return [
        {
            "terrain": terrain,
            "evidence": "labels",
            "between": f"{position} and its boxes",
            **{name: rig.metrics.get(name, np.nan) for name in LABEL_METRICS},
        }
        for position, rig in sorted(read_all_localised(folder).items())
    ]


def _write(stem: Path, rows: list[dict[str, Any]], schema: Table, caption: str, origin: Mapping[str, str]) -> None:
    _write_frame(stem, pd.DataFrame(rows, columns=list(schema.columns)).astype(schema.dtypes), caption, origin)


def _write_frame(stem: Path, table: pd.DataFrame, caption: str, origin: Mapping[str, str]) -> None:
    shown = table.dropna(axis="columns", how="all")
    write_table(stem, with_origin(table, origin), caption, layout=shown, notes=[origin_note(origin)])

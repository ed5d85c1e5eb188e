"""Tables of single stages: cameras, alignment of scans and labels, rocks, meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_csv, read_parquet, typed
from polarsim.geometry.poses import yaw_pitch_roll
from polarsim.photo import Terrain
from polarsim.report.layout import write_table
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.schemas import report
from polarsim.scoring.metrics import COLUMNS as METRIC_COLUMNS

CAMERA_METRICS = ("sd_mm", "sd_deg", "off_survey_m", "off_survey_deg", "median_off_before_px", "median_off_px")
CAMERA_ERRORS = {"position_error_aligned": "error_mm", "angle_error_aligned": "error_deg"}
REPROJECTIONS = ("reprojection", "rock_reprojection")
ALIGNMENT_FILE = "alignment.csv"  # of the cameras stage
LABEL_METRICS = ("matched", "mean_iou", "median_dx_px", "median_dy_px")

CAMERA_CAPTION = (
    "Left cameras: pose in the sandbox frame, formal standard deviations, distance from the survey; offset of the "
    "photos from the shaded meshes before and after the refinement; errors against truth after one rigid alignment of "
    "the terrain's cameras; reprojection of true rocks after this alignment, and with meshes on the true surface."
)
ALIGNMENT_CAPTION = (
    "Alignment: overlap and residual of scan pairs, or of projected meshes and the boxes that cameras were fitted to."
)
ROCK_CAPTION = (
    "Rocks: position, size above the ground (table meshes gives the source of the ground), and the positions whose "
    "labels confirm the rock."
)
MESH_CAPTION = (
    "Meshes: source (a fitted ground is interpolated from the feet of the rocks, without craters and mounds), defects, "
    "contact with the ground, decimated copy, and distance from the visible true surface."
)


def tabulate_cameras(
    *,
    cameras: Mapping[Terrain, Path],
    evaluation: Sequence[Path],
    table: Path,
    alignment: Path,
    origin: Mapping[str, str],
) -> None:
    """Write the tables of cameras and of alignment from the camera folders and metric files of the terrains.

    `table` and `alignment` are paths without suffix.
    """
    localised = {terrain: read_all_localised(folder) for terrain, folder in sorted(cameras.items())}
    metrics = pd.concat([read_csv(path, METRIC_COLUMNS) for path in evaluation], ignore_index=True)
    rows = [
        _camera_row(terrain, *item, metrics) for terrain, rigs in localised.items() for item in sorted(rigs.items())
    ]
    _write(table, typed(rows, report.CAMERAS), CAMERA_CAPTION, origin)
    rows = [row for terrain, folder in sorted(cameras.items()) for row in _alignment_rows(terrain, folder)]
    _write(alignment, typed(rows, report.ALIGNMENT), ALIGNMENT_CAPTION, origin)


def tabulate_rocks(
    *,
    rocks: Mapping[Terrain, Path],
    scores: Mapping[Terrain, Path],
    table: Path,
    meshes: Path,
    origin: Mapping[str, str],
) -> None:
    """Write the tables of rocks and of meshes from rocks.parquet and the mesh scores of the terrains.

    `table` and `meshes` are paths without suffix.
    """
    parts = {terrain: read_parquet(path, ["rock", "source"]) for terrain, path in rocks.items()}
    named = _with_terrain(parts).rename(columns={"source": "found_by"})  # in report tables, `source` is the run's
    _write(table, named, ROCK_CAPTION, origin)
    parts = {terrain: read_csv(path, ["mesh"]) for terrain, path in scores.items()}
    _write(meshes, _with_terrain(parts), MESH_CAPTION, origin)


def _with_terrain(parts: Mapping[Terrain, pd.DataFrame]) -> pd.DataFrame:
    """Concatenate tables by terrain, with the terrain in the first column."""
    rows = pd.concat([part.assign(terrain=terrain) for terrain, part in sorted(parts.items())], ignore_index=True)
    return rows[["terrain", *(name for name in rows.columns if name != "terrain")]]


def _camera_row(terrain: Terrain, position: str, rig: LocalisedRig, metrics: pd.DataFrame) -> dict[str, Any]:
    x, y, z = rig.sandbox_from_left.translation
    angles = np.degrees(yaw_pitch_roll(rig.sandbox_from_left))
    of_position = metrics[
        (metrics["terrain"] == terrain) & metrics["subject"].isin([position, f"{position} L", f"{position} R"])
    ]
    value = {(row.subject, row.metric): row.value for row in of_position.itertuples()}
    return {
        "terrain": terrain, "position": position, "method": rig.method, "x_m": x, "y_m": y, "z_m": z,
        **dict(zip(("yaw_deg", "pitch_deg", "roll_deg"), angles, strict=True)),
        **{name: rig.metrics.get(name, np.nan) for name in CAMERA_METRICS},
        **{column: value.get((position, metric), np.nan) for metric, column in CAMERA_ERRORS.items()},
        **{
            f"{name}_{camera.lower()}_px": value.get((f"{position} {camera}", f"{name}_median"), np.nan)
            for name in REPROJECTIONS
            for camera in "LR"
        },
    }  # fmt: skip


def _alignment_rows(terrain: Terrain, folder: Path) -> list[dict[str, Any]]:
    """Return a row per pair of scans; without scans, a row per position with the fit of the boxes."""
    scans = folder / ALIGNMENT_FILE
    if scans.exists():
        pairs = read_csv(scans).rename(columns={"pair": "between"}).assign(terrain=terrain, evidence="scans")
        return pairs.to_dict("records")  # type: ignore[return-value]
    return [
        {
            "terrain": terrain,
            "evidence": "labels",
            "between": f"{position} and its boxes",
            **{name: rig.metrics.get(name, np.nan) for name in LABEL_METRICS},
        }
        for position, rig in sorted(read_all_localised(folder).items())
    ]


def _write(stem: Path, table: pd.DataFrame, caption: str, origin: Mapping[str, str]) -> None:
    write_table(stem, table, caption, layout=table.dropna(axis="columns", how="all"), origin=origin)

"""Axes, orientation, height and volume of every meshed rock of a terrain, and the area of the examined ground."""

from __future__ import annotations

import logging
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import ReconstructionError
from polarsim.formats import obj, ply, tables
from polarsim.formats.files import write_json
from polarsim.geometry import rock_axes
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.rocks.ground import GROUND_CELL
from polarsim.run_files.scene import PUBLISHED, SCANNED, mesh_origins, read_terrain
from polarsim.schemas.stages import ROCK_SIZES
from polarsim.site import Site

log = logging.getLogger("polarsim")
# 68th percentiles of relative errors of 112 scanned rocks of the analog (terrains 1, 3, 11 with seed 1 and 4, 8, 12
# with seed 5) against the true meshes cut at the ground, from `tables/rock_sizes`.
ERRORS_FILE = Path(__file__).with_name("size_errors.csv")
ERRORS = ("a_error_m", "b_error_m", "c_error_m", "height_error_m", "volume_error_m3", "diameter_error_m")


def measure_rocks(*, site: Site, terrain: Terrain, meshes: Path, clouds: Path | None, sizes: Path, area: Path) -> None:
    """Write a row per meshed rock, and the area of the ground on which rocks were searched.

    The area is that of the scanned ground and of rocks if the folder `clouds` is given, otherwise of the ground mesh.
    Rocks without an exposed part cause a warning.
    """
    scene, origins = read_terrain(meshes, terrain, site.sandbox_of(terrain)), mesh_origins(meshes)
    ground = scene.part(NO_ROCK)
    rows = []
    for rock in scene.rocks:
        made_from = origins.get(obj.rock_name(terrain, rock), PUBLISHED)
        try:
            exposed, volume = rock_axes.exposed_mesh(scene.part(rock), ground.vertices)
        except ReconstructionError as error:
            log.warning("terrain %s, rock %d has no axes: %s", terrain_text(terrain), rock, error)
        else:
            rows.append({"rock": rock, **size_row(exposed, volume, made_from)})
    table = size_table(rows)
    examined = plan_area(ground)
    if clouds is not None:
        seen = len(ply.read_ply(Path(clouds) / "ground.ply")) * GROUND_CELL**2
        examined = seen + float((np.pi / 4 * table["diameter_m"] ** 2).sum())
    tables.write_parquet(sizes, table)
    write_json(area, {"area_m2": round(examined, 4)})


def size_row(exposed: rock_axes.ExposedSizes, volume: float, made_from: str) -> dict[str, object]:
    """Return the sizes of a rock by column of `ROCK_SIZES`; expected errors are known for scanned rocks only."""
    a, b, c = exposed.axes.lengths.tolist()
    sizes = {
        "a_m": a, "b_m": b, "c_m": c, "height_m": exposed.height, "volume_m3": volume, "diameter_m": exposed.diameter
    }  # fmt: skip
    shares = relative_errors(a) if made_from == SCANNED else dict.fromkeys(ERRORS, np.nan)
    return {
        **sizes,
        "length_m": exposed.length, "width_m": exposed.width,
        "a_azimuth_deg": np.degrees(exposed.axes.trend), "a_plunge_deg": np.degrees(exposed.axes.plunge),
        "made_from": made_from,
        **{error: shares[error] * sizes[error.replace("_error", "")] for error in ERRORS},
    }  # fmt: skip


def relative_errors(a: float) -> dict[str, float]:
    """Return the relative errors of a scanned rock with a long axis of `a` metres, by column of `ERRORS`."""
    table = _errors()
    row = table[table["smallest_a_m"] <= a].iloc[-1]
    return {name: float(row[name]) for name in ERRORS}


def size_table(rows: list[dict[str, object]]) -> pd.DataFrame:
    """Return rows in the order of ids as a table of `ROCK_SIZES`, to a tenth of a millimetre and of a degree."""
    table = tables.typed(rows, ROCK_SIZES)
    decimals = {
        name: 1 if name.endswith("_deg") else 4 for name, kind in ROCK_SIZES.dtypes.items() if kind == "float64"
    }
    return table.round({**decimals, "volume_m3": 7, "volume_error_m3": 7}).sort_values("rock", ignore_index=True)


def plan_area(mesh: Mesh) -> float:
    """Return the area of a height field in plan, m^2."""
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    return float(np.abs(np.cross(b - a, c - a)).sum() / 2)


@cache
def _errors() -> pd.DataFrame:
    return tables.read_csv(ERRORS_FILE, ["smallest_a_m", *ERRORS])

"""Ground truth of the analog: exact cameras, lamps, rocks and meshes, and the albedo of visible surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.analog.ground import HeightField
from polarsim.analog.options import AnalogOptions
from polarsim.analog.rays import RayCaster
from polarsim.analog.rocks import SimulatedRock, icosphere
from polarsim.analog.sandbox import HALL_OBJECT
from polarsim.analog.terrain import AnalogTerrain
from polarsim.analog.view import GBuffer, pixels, strips
from polarsim.formats import obj, tables
from polarsim.formats.files import write_json
from polarsim.geometry.meshes import Mesh
from polarsim.run_files.rigs import LocalisedRig, write_localised

_GROUND_STEP = 0.015  # step of the ground mesh, metres
_COLUMN_STEP = 0.002  # metres
CUBE = 0.01  # side of the cubes over which albedo is averaged, metres
_REACH = 4096  # maximum number of cubes from the origin along every axis
_COLUMNS = ("pixels", "albedo", "x", "y", "z")


def write_truth(made: AnalogTerrain, folder: Path, options: AnalogOptions) -> None:
    """Write the ground truth of a terrain except the labels. Rock meshes contain only the part above the sand."""
    stations, scene, terrain = made.stations, made.scene, made.terrain
    for position, pose in stations.sandbox_from_left.items():
        write_localised(folder / "cameras" / f"Pos{position}.json", LocalisedRig(stations.rig, pose, "truth"))
    write_json(folder / "lamps.json", {name: lamp_position.tolist() for name, lamp_position in stations.lamps.items()})
    faces = icosphere(options.rock_detail)[1]
    rows = []
    for rock in scene.rocks:
        above = faces_above_sand(rock, scene.ground, faces)
        used, index = np.unique(above, return_inverse=True)
        name = obj.rock_name(terrain, rock.rock)
        obj.write_obj(folder / "meshes" / name, Mesh(rock.vertices[used], index.reshape(above.shape)), Path(name).stem)
        rows.append(true_rock_row(rock, scene.ground, faces))
    columns = ["rock", "x", "y", "z", "size_m", "height_m", "volume_m3"]
    tables.write_parquet(folder / "rocks.parquet", pd.DataFrame(rows, columns=columns).astype({"rock": "int64"}))
    ground: HeightField = scene.ground.coarser(_GROUND_STEP)
    name = obj.ground_name(terrain)
    obj.write_obj(folder / "meshes" / name, Mesh(*ground.mesh()), Path(name).stem)


def true_rock_row(rock: SimulatedRock, ground: HeightField, faces: np.ndarray) -> dict[str, float]:
    """Return centre, longest side, height and volume of the part of a rock above the sand, metres."""
    above = rock.vertices[np.unique(faces_above_sand(rock, ground, faces))]
    low, high = above.min(axis=0), above.max(axis=0)
    level = float(np.median(ground.height_at(above[:, 0], above[:, 1])))
    centre = (low + high) / 2
    return {
        "rock": rock.rock, "x": centre[0], "y": centre[1], "z": centre[2], "size_m": float((high - low).max()),
        "height_m": float(high[2] - level), "volume_m3": _volume(rock, ground, faces),
    }  # fmt: skip


def faces_above_sand(rock: SimulatedRock, ground: HeightField, faces: np.ndarray, below: float = 0.003) -> np.ndarray:
    """Return the faces (f, 3) with a vertex above the sand minus `below` metres."""
    clear = rock.vertices[:, 2] > ground.height_at(rock.vertices[:, 0], rock.vertices[:, 1]) - below
    return faces[clear[faces].any(axis=1)]


def _volume(rock: SimulatedRock, ground: HeightField, faces: np.ndarray) -> float:
    """Return the volume above the sand, summed over columns between the upper and lower side of the rock."""
    low, high = rock.vertices.min(axis=0), rock.vertices.max(axis=0)
    x, y = np.meshgrid(
        *(np.arange(low[axis], high[axis], _COLUMN_STEP) + _COLUMN_STEP / 2 for axis in (0, 1)), indexing="ij"
    )
    caster = RayCaster(rock.vertices, faces)
    heights = []
    for start, down in ((high[2] + 0.1, -1.0), (low[2] - 0.1, 1.0)):
        origins = np.stack([x, y, np.full_like(x, start)], axis=-1)
        hit = caster.first_hits(origins, np.broadcast_to([0.0, 0.0, down], origins.shape))
        heights.append(start + down * hit.distance)
    top, bottom = heights
    solid = np.isfinite(top) & np.isfinite(bottom)
    column = top[solid] - np.maximum(bottom[solid], ground.height_at(x[solid], y[solid]))
    return float(np.clip(column, 0, None).sum() * _COLUMN_STEP**2)


class AlbedoMap:
    """Mean albedo of sand and rocks in cubes, accumulated over the pixels of all views."""

    def __init__(self) -> None:
        self._cubes = np.zeros(0, np.int64)
        self._sums = np.zeros((0, len(_COLUMNS)))

    def add(self, sums: Sequence[AlbedoSums]) -> None:
        """Add the sums of a view."""
        cubes, parts = [self._cubes, *(each.cubes for each in sums)], [self._sums, *(each.sums for each in sums)]
        self._cubes, number = np.unique(np.concatenate(cubes), return_inverse=True)
        self._sums = np.stack([np.bincount(number, part, len(self._cubes)) for part in np.concatenate(parts).T], axis=1)

    def table(self) -> pd.DataFrame:
        """Return one row per cube: rock (-1: sand), mean position x, y, z, mean albedo and number of the pixels."""
        pixels = self._sums[:, 0]
        means = self._sums[:, 1:] / np.maximum(pixels, 1)[:, None]
        rock = self._cubes // (2 * _REACH) ** 3 - 1
        table = pd.DataFrame({"rock": rock.astype(np.int64)})
        for axis, name in enumerate("xyz"):
            table[name] = np.round(means[:, 1 + axis], 5).astype(np.float32)
        table["albedo"] = means[:, 0].astype(np.float32)
        table["pixels"] = pixels.astype(np.int64)
        return table


@dataclass(frozen=True)
class AlbedoSums:
    """Sums over pixels by cube of sand or of a rock."""

    cubes: np.ndarray  # (c,) numbers of `_cube_of`
    sums: np.ndarray  # (c, 5): number of pixels, sums of albedo, x, y and z


def albedo_sums(view: GBuffer) -> list[AlbedoSums]:
    """Return sums over the pixels of sand and rocks of a view, strip by strip."""
    result = []
    for rows in strips(len(view.objects)):
        chosen = np.flatnonzero(view.objects[rows] != HALL_OBJECT)
        points, objects, albedo = (pixels(part[rows], chosen) for part in (view.points, view.objects, view.albedo))
        points = points.astype(float)
        cubes, of_pixel = np.unique(_cube_of(points, objects), return_inverse=True)
        values = (np.ones(len(points)), albedo, *points.T)
        sums = [np.bincount(of_pixel, value, len(cubes)) for value in values]
        result.append(AlbedoSums(cubes, np.stack(sums, axis=1)))
    return result


def _cube_of(points: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """Return a number (n,) that encodes object and cube; sand is object -1."""
    cell = np.clip(np.floor(points / CUBE).astype(np.int64) + _REACH, 0, 2 * _REACH - 1)
    number = objects.astype(np.int64) + 1
    for axis in range(3):
        number = number * 2 * _REACH + cell[:, axis]
    return number

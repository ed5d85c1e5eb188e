"""A terrain for the 3-D view: decimated meshes with vertex attributes, cameras, lamps."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from polarsim.formats import obj
from polarsim.formats.tables import read_parquet
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.run_files import lamps, rigs
from polarsim.run_files.run import Run
from polarsim.run_files.scene import mesh_files

GROUND_CELL, ROCK_CELL = 0.018, 0.008  # cell sizes of vertex clustering, metres
REACH = 0.06  # maximum distance between a measured error and a vertex, metres

Trees = dict[int, tuple[cKDTree, np.ndarray]]  # by rock: points of measured errors, and the errors, mm


@lru_cache(maxsize=2)  # vertices and faces are requested in succession
def thinned_terrain(run: Run, terrain: Terrain) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """Return tables of vertices and faces of decimated ground and rocks; None if the terrain has no meshes.

    Vertices: x, y, z (sandbox frame, metres), normal nx, ny, nz, rock (-1: ground), support (0: interpolated, 1:
    scanned) and error_mm (signed distance from the true surface, negative inside; NaN if not known). Faces: a, b, c.
    """
    folder = run.folder / "meshes" / f"Terrain{terrain_text(terrain)}"
    if not (folder / obj.ground_name(terrain)).exists():
        return None
    supports, errors = _supports(folder), _errors(run, terrain)
    vertices, faces, start = [], [], 0
    for rock, path in mesh_files(folder, terrain).items():
        full = obj.read_obj(path)
        mesh, cluster = clustered(full, GROUND_CELL if rock == NO_ROCK else ROCK_CELL)
        support = supports.get(path.name, np.ones(len(full.vertices)))
        columns = [*mesh.vertices.T, *mesh.normals().T, np.full(len(mesh.vertices), float(rock))]
        columns += [_mean(support, cluster), _nearest(errors.get(rock), mesh.vertices)]
        vertices.append(np.stack(columns, axis=1))
        faces.append(mesh.faces + start)
        start += len(mesh.vertices)
    names = ["x", "y", "z", "nx", "ny", "nz", "rock", "support", "error_mm"]
    table = pd.DataFrame(np.concatenate(vertices), columns=names).astype({"rock": np.int64})
    return table, pd.DataFrame(np.concatenate(faces), columns=["a", "b", "c"])


def clustered(mesh: Mesh, cell: float) -> tuple[Mesh, np.ndarray]:
    """Decimate a mesh by vertex clustering on a grid; return the mesh and the new index of each vertex (v,).

    The index is -1 for vertices without remaining faces. The result is for display only and may have holes.
    """
    cells = np.floor(mesh.vertices / cell).astype(np.int64)
    cells -= cells.min(axis=0)
    cubes = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    _, cluster = np.unique(cubes, return_inverse=True)
    means = np.stack([np.bincount(cluster, axis) for axis in mesh.vertices.T], axis=1) / np.bincount(cluster)[:, None]
    faces = cluster[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used, numbers = np.unique(faces, return_inverse=True)
    new_index = np.full(len(means), -1)
    new_index[used] = np.arange(len(used))
    return Mesh(means[used], numbers.reshape(faces.shape)), new_index[cluster]


def _mean(values: np.ndarray, cluster: np.ndarray) -> np.ndarray:
    """Return the mean value of each cluster of vertices."""
    kept = cluster >= 0
    return np.asarray(np.bincount(cluster[kept], values[kept]) / np.maximum(np.bincount(cluster[kept]), 1))


def _supports(folder: Path) -> dict[str, np.ndarray]:
    """Return the support of every vertex by mesh; empty without scans."""
    path = folder / "support.parquet"
    if not path.exists():
        return {}
    table = read_parquet(path, ["mesh", "vertex", "support"])
    values = table["support"].to_numpy(float)
    return {str(mesh): values[rows] for mesh, rows in table.groupby("mesh").indices.items()}


def _errors(run: Run, terrain: Terrain) -> Trees:
    table = run.table(f"evaluation/offsets_Terrain{terrain_text(terrain)}.parquet")
    if table is None:
        return {}
    points, offsets = table[["x", "y", "z"]].to_numpy(float), table["offset_mm"].to_numpy(float)
    groups = table.groupby("rock").indices.items()
    return {int(str(rock)): (cKDTree(points[rows]), offsets[rows]) for rock, rows in groups}


def _nearest(tree: tuple[cKDTree, np.ndarray] | None, vertices: np.ndarray) -> np.ndarray:
    """Return the nearest measured error of each vertex, or NaN beyond `REACH`."""
    if tree is None:
        return np.full(len(vertices), np.nan)
    _, nearest = tree[0].query(vertices, distance_upper_bound=REACH)
    return np.append(tree[1], np.nan)[nearest]


def as_rows(values: np.ndarray) -> list[float]:
    """Return the numbers of an array as a flat list, rounded to 4 decimals, for JSON files of the page."""
    return [round(float(value), 4) for value in np.asarray(values).ravel()]


def terrain_setup(run: Run, terrain: Terrain) -> dict[str, Any]:
    """Return cameras and lamps of a terrain in the sandbox frame, metres; lenses in pixels."""
    folder = run.folder / "cameras" / f"Terrain{terrain_text(terrain)}"
    localised = rigs.read_all_localised(folder) if folder.exists() else {}
    cameras = [
        {
            "position": position,
            "camera": side,
            "method": rig.method,
            "sandbox_from_camera": as_rows(rig.sandbox_from(side).matrix),
            "lens": as_rows(rig.rig.lens(side).opencv_matrix()[[0, 1, 0, 1], [0, 1, 2, 2]]),
        }
        for position, rig in localised.items()
        for side in rig.rig.sides
    ]
    site = run.site
    positions = lamps.read_suns(folder, localised, site, terrain)
    suns = {name: as_rows(position) for name, position in sorted(positions.items())}
    return {
        "cameras": cameras,
        "lamps": suns if localised else {},
        "rover_lights": {
            position: as_rows(rig.rover_light(site.rig_lamp)) for position, rig in localised.items() if site.rig_lamp
        },
    }

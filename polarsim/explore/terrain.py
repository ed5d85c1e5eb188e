"""A terrain for the 3-D view: thinned meshes with what is known of each vertex, cameras, lamps."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from polarsim.explore.rows import as_rows
from polarsim.formats import obj
from polarsim.formats.tables import read_parquet
from polarsim.geometry.meshes import Mesh
from polarsim.photo import CAMERAS, NO_ROCK
from polarsim.run_files import lamps, rigs
from polarsim.run_files.run import Run
from polarsim.run_files.scene import mesh_files

GROUND_CELL, ROCK_CELL = 0.018, 0.008  # metres to which the ground's and rocks' vertices are thinned
REACH = 0.06  # metres within which a measured error belongs to a vertex

Trees = dict[int, tuple[cKDTree, np.ndarray]]  # by rock: where errors were measured, and these, mm


@lru_cache(maxsize=2)  # vertices and faces are asked for one after the other
def thinned_terrain(run: Run, terrain: int) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """Vertices and faces of a terrain's ground and rocks, thinned for looking at; None where it has no meshes.

    Vertices have x, y, z (sandbox, metres), the normal nx, ny, nz, rock (-1: ground), support (0 to 1: filled in or
    scanned) and error_mm (from the true surface, below 0 inside it; NaN where it is not known); faces a, b, c.
    """
    folder = run.folder / "meshes" / f"Terrain{terrain:02d}"
    if not (folder / obj.ground_name(terrain)).exists():
        return None
    supports, errors = _supports(folder), _errors(run, terrain)
    vertices, faces, start = [], [], 0
    for rock, path in mesh_files(folder, terrain).items():
        full = obj.read(path)
        mesh, cluster = clustered(full, GROUND_CELL if rock == NO_ROCK else ROCK_CELL)
        known = supports.get(path.name, np.ones(len(full.vertices)))
        columns = [*mesh.vertices.T, *mesh.normals().T, np.full(len(mesh.vertices), float(rock))]
        columns += [_mean(known, cluster), _nearest(errors.get(rock), mesh.vertices)]
        vertices.append(np.stack(columns, axis=1))
        faces.append(mesh.faces + start)
        start += len(mesh.vertices)
    names = ["x", "y", "z", "nx", "ny", "nz", "rock", "support", "error_mm"]
    table = pd.DataFrame(np.concatenate(vertices), columns=names).astype({"rock": np.int64})
    return table, pd.DataFrame(np.concatenate(faces), columns=["a", "b", "c"])


def clustered(mesh: Mesh, cell: float) -> tuple[Mesh, np.ndarray]:
    """The mesh with all vertices of a cube of a grid put together at their mean; and which vertex each became, (v,).

    For looking at: holes may open. -1 stands for vertices that no face is left of.
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
    became = np.full(len(means), -1)
    became[used] = np.arange(len(used))
    return Mesh(means[used], numbers.reshape(faces.shape)), became[cluster]


def _mean(values: np.ndarray, cluster: np.ndarray) -> np.ndarray:
    """Mean value of the vertices that became one."""
    kept = cluster >= 0
    return np.asarray(np.bincount(cluster[kept], values[kept]) / np.maximum(np.bincount(cluster[kept]), 1))


def _supports(folder: Path) -> dict[str, np.ndarray]:
    """Support of every vertex by mesh; empty where no scan tells."""
    path = folder / "support.parquet"
    if not path.exists():
        return {}
    table = read_parquet(path, ["mesh", "vertex", "support"])
    values = table["support"].to_numpy(float)
    return {str(mesh): values[rows] for mesh, rows in table.groupby("mesh").indices.items()}


def _errors(run: Run, terrain: int) -> Trees:
    table = run.table(f"evaluation/offsets_Terrain{terrain:02d}.parquet")
    if table is None:
        return {}
    points, offsets = table[["x", "y", "z"]].to_numpy(float), table["offset_mm"].to_numpy(float)
    groups = table.groupby("rock").indices.items()
    return {int(str(rock)): (cKDTree(points[rows]), offsets[rows]) for rock, rows in groups}


def _nearest(tree: tuple[cKDTree, np.ndarray] | None, vertices: np.ndarray) -> np.ndarray:
    """The error that was measured nearest to each vertex; NaN farther away than `REACH`."""
    if tree is None:
        return np.full(len(vertices), np.nan)
    _, nearest = tree[0].query(vertices, distance_upper_bound=REACH)
    return np.append(tree[1], np.nan)[nearest]


def surroundings(run: Run, terrain: int) -> dict[str, Any]:
    """Cameras and lamps of a terrain in the sandbox frame: metres, lenses in pixels."""
    folder = run.folder / "cameras" / f"Terrain{terrain:02d}"
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
        for side in CAMERAS
    ]
    suns = {azimuth: as_rows(position) for azimuth, position in sorted(lamps.read_suns(folder, localised).items())}
    return {
        "cameras": cameras,
        "lamps": suns if localised else {},
        "rover_lights": {position: as_rows(rig.rover_light) for position, rig in localised.items()},
    }

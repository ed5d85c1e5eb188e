"""Output folder of a terrain's meshes: names, decimated copies, mesh table, and support of each vertex by scans."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from polarsim.formats import gltf, obj, tables
from polarsim.formats.files import writing_folder
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, part_of_face
from polarsim.photo import NO_ROCK, Terrain
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.solids import cluster_vertices, decimate_mesh, volume
from polarsim.run_files.scene import MESH_TABLE
from polarsim.run_files.walls import Walls, write_walls
from polarsim.schemas.stages import MESHES

MAX_VIEWER_VERTICES = 250_000  # maximum number of ground vertices in the file for viewers
DECIMATED_SHARE = 0.05  # share of the vertices in decimated copies, as in the release
SUPPORT_FILE = "support.parquet"
FULL_SUPPORT, NO_SUPPORT = 1.5, 5.0  # maximum and minimum distance to the next scanned point, spacings


class Scanned(NamedTuple):
    """Scanned points (n, 3) of a surface, metres, and their spacing in densely scanned parts."""

    points: np.ndarray
    spacing: float


def support(vertices: np.ndarray, scanned: Scanned) -> np.ndarray:
    """Return the support (v,) of vertices (v, 3): 1 next to a scanned point, decreasing to 0 at `NO_SUPPORT` spacings.

    The support distinguishes measured surfaces from filled holes.
    """
    if not len(scanned.points):
        return np.zeros(len(vertices))
    reach = NO_SUPPORT * scanned.spacing
    distance = np.asarray(KDTree(scanned.points).query(vertices, distance_upper_bound=reach)[0])
    return np.clip((NO_SUPPORT - np.minimum(distance, reach) / scanned.spacing) / (NO_SUPPORT - FULL_SUPPORT), 0.0, 1.0)


def support_table(support_of_mesh: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """Return a row for each vertex: file name of the mesh, index of the vertex, support rounded to 0.01."""
    names = pd.Categorical(np.repeat(list(support_of_mesh), [len(values) for values in support_of_mesh.values()]))
    vertices = [np.arange(len(values), dtype=np.int32) for values in support_of_mesh.values()]
    values = np.concatenate(list(support_of_mesh.values()))
    return pd.DataFrame(
        {"mesh": names, "vertex": np.concatenate(vertices), "support": np.round(values, 2).astype(np.float32)}
    )


def height_mesh(grid: FloorGrid, heights: np.ndarray) -> Mesh:
    """Return two triangles per cell between the centres of the grid's cells, facing up, cut by the shorter diagonal."""
    rows, columns = grid.shape
    vertices = np.concatenate([grid.centres(), heights[..., None]], axis=-1).reshape(-1, 3)
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    flat = heights.ravel()
    along = (np.abs(flat[a] - flat[c]) <= np.abs(flat[b] - flat[d]))[..., None]
    first = np.where(along, np.stack([a, b, c], axis=-1), np.stack([a, b, d], axis=-1))
    second = np.where(along, np.stack([a, c, d], axis=-1), np.stack([b, c, d], axis=-1))
    return Mesh(vertices, np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)]))


def write_meshes(
    terrain: Terrain,
    meshes: Path,
    solids: Mapping[int, Mesh],
    ground: Mesh,
    sources: Mapping[int, str],
    scanned: Mapping[int, Scanned] | None = None,
    walls: Walls | None = None,
) -> None:
    """Write a terrain's meshes under the release's names, a table of them, measured walls, and a glTF for viewers.

    `sources` is the source of each rock, and of the ground under `NO_ROCK`. If the points in `scanned` are given for
    rocks (and for the ground under `NO_ROCK`), a table of the vertices' support is written.
    """
    scanned = scanned or {}
    with writing_folder(meshes) as folder:
        parts = {NO_ROCK: ground, **dict(sorted(solids.items()))}
        names = {rock: obj.rock_name(terrain, rock) for rock in parts} | {NO_ROCK: obj.ground_name(terrain)}
        named, made_from = {names[NO_ROCK]: ground}, {names[NO_ROCK]: sources[NO_ROCK]}
        for rock, mesh in sorted(solids.items()):
            thin = obj.rock_name(terrain, rock, decimated=True)
            named |= {names[rock]: mesh, thin: decimate_mesh(mesh, DECIMATED_SHARE)}
            made_from |= dict.fromkeys((names[rock], thin), sources[rock])
        write_named(folder, named, made_from)
        if walls is not None:
            write_walls(folder, walls)
        known = {rock: support(mesh.vertices, scanned[rock]) for rock, mesh in parts.items() if rock in scanned}
        if scanned:
            table = support_table({names[rock]: values for rock, values in known.items()})
            tables.write_parquet(folder / SUPPORT_FILE, table)
        parts[NO_ROCK] = cluster_vertices(ground, MAX_VIEWER_VERTICES)
        if scanned and parts[NO_ROCK] is not ground:
            known[NO_ROCK] = support(parts[NO_ROCK].vertices, scanned[NO_ROCK])
        nodes = {rock: gltf.GROUND_NODE if rock == NO_ROCK else f"rock{rock}" for rock in parts}
        gltf.write_glb(
            folder / gltf.name(terrain),
            {nodes[rock]: mesh for rock, mesh in parts.items()},
            {nodes[rock]: values for rock, values in known.items()},
        )


def write_named(folder: Path, named: Mapping[str, Mesh], made_from: Mapping[str, str]) -> None:
    """Write meshes by file name, and `meshes.csv` with their properties and sources."""
    for name, mesh in named.items():
        obj.write_obj(folder / name, mesh, Path(name).stem)
    rows = [{**mesh_row(name, mesh), "made_from": made_from[name]} for name, mesh in named.items()]
    tables.write_csv(folder / MESH_TABLE, pd.DataFrame(rows, columns=list(MESHES.columns)))


def mesh_row(name: str, mesh: Mesh) -> dict[str, object]:
    """Return a row of `meshes.csv`; an open mesh has no volume."""
    closed = is_watertight(mesh.faces)
    return {
        "mesh": name,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "islands": int(part_of_face(mesh.faces).max(initial=-1)) + 1,
        "watertight": closed,
        "volume_m3": volume(mesh) if closed else np.nan,
    }

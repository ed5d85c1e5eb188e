"""The folder of a terrain's meshes: names, decimated copies, figures, and how well scans support each vertex."""

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
from polarsim.photo import NO_ROCK
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.solids import decimated, thinned, volume
from polarsim.run_files.scene import MESH_TABLE
from polarsim.schemas.stages import MESHES

MOST_SHOWN = 250_000  # vertices of the ground in the file for viewers
DECIMATED_SHARE = 0.05  # of the vertices that decimated copies keep, as the release's do
SUPPORT_FILE = "support.parquet"
NEAR, FAR = 1.5, 5.0  # spacings to the next scanned point: full support up to the first, none from the second on


class Scanned(NamedTuple):
    """Scanned points (n, 3) of one surface, metres, and how far apart they lie where nothing is missing."""

    points: np.ndarray
    spacing: float


def support(vertices: np.ndarray, scanned: Scanned) -> np.ndarray:
    """(v,) 1 where a scanned point lies beside a vertex (v, 3), falling to 0 at `FAR` spacings.

    So what was filled in does not pass for measured.
    """
    if not len(scanned.points):
        return np.zeros(len(vertices))
    reach = FAR * scanned.spacing
    distance = np.asarray(KDTree(scanned.points).query(vertices, distance_upper_bound=reach)[0])
    return np.clip((FAR - np.minimum(distance, reach) / scanned.spacing) / (FAR - NEAR), 0.0, 1.0)


def support_table(support_of_mesh: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """A row a vertex: the mesh's file name, the vertex's number from 0, its support to a hundredth."""
    names = pd.Categorical(np.repeat(list(support_of_mesh), [len(values) for values in support_of_mesh.values()]))
    vertices = [np.arange(len(values), dtype=np.int32) for values in support_of_mesh.values()]
    values = np.concatenate(list(support_of_mesh.values()))
    return pd.DataFrame(
        {"mesh": names, "vertex": np.concatenate(vertices), "support": np.round(values, 2).astype(np.float32)}
    )


def height_mesh(grid: FloorGrid, heights: np.ndarray) -> Mesh:
    """Two triangles a cell between the centres of the grid's cells, facing up; the shorter diagonal cuts each cell."""
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
    terrain: int,
    meshes: Path,
    solids: Mapping[int, Mesh],
    ground: Mesh,
    sources: Mapping[int, str],
    scanned: Mapping[int, Scanned] | None = None,
) -> None:
    """Write a terrain's meshes under the release's names, a table of their figures, and a glTF file for viewers.

    `sources` says what each rock, and the ground under `NO_ROCK`, was made from. With what was `scanned` of each rock
    (of the ground under `NO_ROCK`) goes a table of the vertices' support.
    """
    scanned = scanned or {}
    with writing_folder(meshes) as folder:
        parts = {NO_ROCK: ground, **dict(sorted(solids.items()))}
        names = {rock: obj.rock_name(terrain, rock) for rock in parts} | {NO_ROCK: obj.ground_name(terrain)}
        named, made_from = {names[NO_ROCK]: ground}, {names[NO_ROCK]: sources[NO_ROCK]}
        for rock, mesh in sorted(solids.items()):
            thin = obj.rock_name(terrain, rock, decimated=True)
            named |= {names[rock]: mesh, thin: decimated(mesh, DECIMATED_SHARE)}
            made_from |= dict.fromkeys((names[rock], thin), sources[rock])
        write_named(folder, named, made_from)
        known = {rock: support(mesh.vertices, scanned[rock]) for rock, mesh in parts.items() if rock in scanned}
        if scanned:
            table = support_table({names[rock]: values for rock, values in known.items()})
            tables.write_parquet(folder / SUPPORT_FILE, table)
        parts[NO_ROCK] = thinned(ground, MOST_SHOWN)
        if scanned and parts[NO_ROCK] is not ground:
            known[NO_ROCK] = support(parts[NO_ROCK].vertices, scanned[NO_ROCK])
        nodes = {rock: gltf.GROUND if rock == NO_ROCK else f"rock{rock}" for rock in parts}
        gltf.write(
            folder / gltf.name(terrain),
            {nodes[rock]: mesh for rock, mesh in parts.items()},
            {nodes[rock]: values for rock, values in known.items()},
        )


def write_named(folder: Path, named: Mapping[str, Mesh], made_from: Mapping[str, str]) -> None:
    """Write meshes by file name, and `meshes.csv` with their figures and what each was made from."""
    for name, mesh in named.items():
        obj.write(folder / name, mesh, Path(name).stem)
    rows = [{**figures(name, mesh), "made_from": made_from[name]} for name, mesh in named.items()]
    tables.write_csv(folder / MESH_TABLE, pd.DataFrame(rows, columns=list(MESHES.columns)))


def figures(name: str, mesh: Mesh) -> dict[str, object]:
    """What `meshes.csv` says of a mesh; an open mesh has no volume."""
    closed = is_watertight(mesh.faces)
    return {
        "mesh": name,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "islands": int(part_of_face(mesh.faces).max(initial=-1)) + 1,
        "watertight": closed,
        "volume_m3": volume(mesh) if closed else np.nan,
    }

"""The folder of a terrain's meshes: names, decimated copies, figures; and the mesh of a height grid."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import gltf, obj, tables
from polarsim.formats.files import writing_folder
from polarsim.formats.scene import MESH_TABLE
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight
from polarsim.photo import NO_ROCK
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.solids import decimated, islands, thinned, volume
from polarsim.rocks.support import FILE as SUPPORT_FILE
from polarsim.rocks.support import Scanned, support, support_table

MOST_SHOWN = 250_000  # vertices of the ground in the file for viewers

DECIMATED_SHARE = 0.05  # of the vertices that decimated copies keep, as the release's do


def height_mesh(grid: FloorGrid, heights: np.ndarray) -> Mesh:
    """Two triangles a cell between the centres of the grid's cells, facing up; the shorter diagonal cuts each cell."""
    rows, columns = grid.shape
    vertices = np.concatenate([grid.places(), heights[..., None]], axis=-1).reshape(-1, 3)
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
        named = {obj.ground_name(terrain): ground}
        made_from = {obj.ground_name(terrain): sources[NO_ROCK]}
        for rock, mesh in sorted(solids.items()):
            named[obj.rock_name(terrain, rock)] = mesh
            named[obj.rock_name(terrain, rock, decimated=True)] = decimated(mesh, DECIMATED_SHARE)
            made_from |= {obj.rock_name(terrain, rock, decimated=copy): sources[rock] for copy in (False, True)}
        write_named(folder, named, made_from)
        parts = {NO_ROCK: ground, **dict(sorted(solids.items()))}
        known = {rock: support(mesh.vertices, scanned[rock]) for rock, mesh in parts.items() if rock in scanned}
        if scanned:
            files = {rock: _file_name(terrain, rock) for rock in known}
            tables.write_parquet(folder / SUPPORT_FILE, support_table({files[rock]: known[rock] for rock in known}))
        parts[NO_ROCK] = thinned(ground, MOST_SHOWN)
        if scanned and parts[NO_ROCK] is not ground:
            known[NO_ROCK] = support(parts[NO_ROCK].vertices, scanned[NO_ROCK])
        nodes = {rock: gltf.GROUND if rock == NO_ROCK else f"rock{rock}" for rock in parts}
        gltf.write(
            folder / gltf.name(terrain),
            {nodes[rock]: mesh for rock, mesh in parts.items()},
            {nodes[rock]: values for rock, values in known.items()},
        )


def _file_name(terrain: int, rock: int) -> str:
    return obj.ground_name(terrain) if rock == NO_ROCK else obj.rock_name(terrain, rock)


def write_named(folder: Path, named: Mapping[str, Mesh], made_from: Mapping[str, str]) -> None:
    """Write meshes by file name, and `meshes.csv` with their figures and what each was made from."""
    for name, mesh in named.items():
        obj.write(folder / name, mesh, Path(name).stem)
    rows = [{**figures(name, mesh), "made_from": made_from[name]} for name, mesh in named.items()]
    tables.write_csv(folder / MESH_TABLE, pd.DataFrame(rows))


def figures(name: str, mesh: Mesh) -> dict[str, object]:
    """What `meshes.csv` says of a mesh; an open mesh has no volume."""
    closed = is_watertight(mesh.faces)
    return {
        "mesh": name,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "islands": int(islands(mesh).max(initial=-1)) + 1,
        "watertight": closed,
        "volume_m3": volume(mesh) if closed else np.nan,
    }

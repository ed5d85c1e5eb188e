"""A terrain's folder of meshes, read as one set of triangles that know their rock."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import obj, tables
from polarsim.formats.files import existing_folder
from polarsim.formats.readers import reader
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK

MESH_TABLE = "meshes.csv"  # beside the meshes: a row a mesh
SCANNED, PUBLISHED, FITTED = "scan", "published", "fitted"  # what a mesh was made from; a fitted ground is a guess


@dataclass(frozen=True)
class TerrainMesh:
    """Ground and rocks: vertices (v, 3) in the sandbox, faces (f, 3), the ground's first, and each one's rock (f,)."""

    vertices: np.ndarray
    faces: np.ndarray
    rock_of_face: np.ndarray  # NO_ROCK is the ground
    given_normals: np.ndarray | None = None  # (v, 3) unit, where they are not those of the triangles

    @cached_property
    def normals(self) -> np.ndarray:
        """(v, 3) unit, per vertex."""
        if self.given_normals is not None:
            return self.given_normals
        return Mesh(self.vertices, self.faces).normals()

    @property
    def rocks(self) -> list[int]:
        return [int(rock) for rock in np.unique(self.rock_of_face) if rock != NO_ROCK]

    @property
    def sand_level(self) -> float:
        """Median height of the ground, metres: near 0 in our own meshes, decimetres off in some published ones."""
        corners = self.faces[self.rock_of_face == NO_ROCK, 0]
        return float(np.median(self.vertices[corners, 2])) if len(corners) else 0.0

    def part(self, rock: int) -> Mesh:
        """The mesh of one rock, or of the ground (`NO_ROCK`)."""
        faces = self.faces[self.rock_of_face == rock]
        used, numbers = np.unique(faces, return_inverse=True)
        return Mesh(self.vertices[used], numbers.reshape(faces.shape))

    def ground(self) -> TerrainMesh:
        """The same terrain without its rocks."""
        own = self.rock_of_face == NO_ROCK
        return TerrainMesh(self.vertices, self.faces[own], self.rock_of_face[own], self.given_normals)

    def rock_vertices(self, rock: int) -> np.ndarray:
        """(n, 3) vertices that a rock's faces use."""
        return self.vertices[np.unique(self.faces[self.rock_of_face == rock])]


def mesh_files(folder: str | Path, terrain: int) -> dict[int, Path]:
    """The files that `read_terrain` reads, by rock, the ground (`NO_ROCK`) first.

    Raises
    ------
    FormatError
        No ground.
    """
    ground = Path(folder) / obj.ground_name(terrain)
    if not ground.exists():
        raise FormatError("the ground mesh is missing", path=ground)
    return {NO_ROCK: ground, **obj.rock_files(folder)}


def terrain_in(folder: str | Path) -> int:
    """The number of the terrain whose meshes a folder holds, as the name of its ground has it.

    Raises
    ------
    FormatError
        No such folder, no ground in it, or those of several terrains.
    """
    grounds = sorted(existing_folder(folder).glob(obj.GROUND_PATTERN))
    if len(grounds) != 1:
        found = ", ".join(path.name for path in grounds) or "none"
        raise FormatError(f"expected the ground of one terrain, {obj.GROUND_PATTERN}; found {found}", path=folder)
    return int(grounds[0].name[7:9])


@reader("mesh table")
def made_from(folder: str | Path) -> dict[str, str]:
    """What each mesh of a folder was made from, by file name: `scan`, `published` or `fitted`; empty without a table.

    Raises
    ------
    FormatError
        The table lacks a column.
    """
    path = Path(folder) / MESH_TABLE
    if not path.exists():
        return {}
    table = tables.read_csv(path, ["mesh", "made_from"])
    if table[["mesh", "made_from"]].isna().any(axis=None):
        raise FormatError("a mesh without its origin", path=path)
    return dict(zip(table["mesh"].astype(str), table["made_from"].astype(str), strict=True))


@reader("terrain")
def read_terrain(folder: str | Path, terrain: int, pool: Executor | None = None) -> TerrainMesh:
    """Read `terrainNN_ground.obj` and every `terrainNN_rock<k>.obj` (full ones where both are there), by a pool's
    threads where one is given.

    Raises
    ------
    FormatError
        No ground, or a broken mesh.
    """
    files = mesh_files(folder, terrain)
    meshes = (pool.map if pool else map)(obj.read, files.values())
    parts = list(zip(files, meshes, strict=True))
    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in parts)])
    return TerrainMesh(
        np.concatenate([mesh.vertices for _, mesh in parts]),
        np.concatenate([mesh.faces + start for (_, mesh), start in zip(parts, starts, strict=False)]),
        np.concatenate([np.full(len(mesh.faces), rock) for rock, mesh in parts]),
    )

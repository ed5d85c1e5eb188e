"""Meshes of a terrain, merged into a single triangle mesh with the rock of each face."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import obj, tables
from polarsim.formats.files import existing_folder
from polarsim.formats.readers import reader
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.photo import NO_ROCK, Terrain, parse_terrain
from polarsim.run_files.walls import THICKNESS_M, Walls, read_walls, surveyed_walls, walls_file
from polarsim.site_parts import Sandbox

MESH_TABLE = "meshes.csv"  # in the folder of the meshes, with a row per mesh
# Origins of meshes; a fitted ground is an estimate, refined by photos if the origin is PHOTOS.
SCANNED, PUBLISHED, FITTED, PHOTOS = "scan", "published", "fitted", "photos"


@dataclass(frozen=True)
class TerrainMesh:
    """Mesh of ground and rocks: vertices (v, 3) in the sandbox frame, faces (f, 3) with the ground first, and rocks."""

    vertices: np.ndarray
    faces: np.ndarray
    rock_of_face: np.ndarray  # (f,); NO_ROCK is the ground
    given_normals: np.ndarray | None = None  # (v, 3) unit normals; None: computed from the triangles
    walls: Walls | None = None  # walls of the sandbox around the ground

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (v, 3) of vertices."""
        if self.given_normals is not None:
            return self.given_normals
        return Mesh(self.vertices, self.faces).normals()

    @property
    def rocks(self) -> list[int]:
        return [int(rock) for rock in np.unique(self.rock_of_face) if rock != NO_ROCK]

    @property
    def sand_level(self) -> float:
        """Median height of the ground, metres: near 0 in polarsim's meshes, up to decimetres in published meshes."""
        corners = self.faces[self.rock_of_face == NO_ROCK, 0]
        return float(np.median(self.vertices[corners, 2])) if len(corners) else 0.0

    def part(self, rock: int) -> Mesh:
        """Return the mesh of a rock, or of the ground (`NO_ROCK`)."""
        faces = self.faces[self.rock_of_face == rock]
        used, numbers = np.unique(faces, return_inverse=True)
        return Mesh(self.vertices[used], numbers.reshape(faces.shape))

    def ground(self) -> TerrainMesh:
        """Return the terrain without rocks."""
        is_ground = self.rock_of_face == NO_ROCK
        return replace(self, faces=self.faces[is_ground], rock_of_face=self.rock_of_face[is_ground])

    def rock_vertices(self, rock: int) -> np.ndarray:
        """Return the vertices (n, 3) of the faces of a rock."""
        return self.vertices[np.unique(self.faces[self.rock_of_face == rock])]


def mesh_files(folder: str | Path, terrain: Terrain) -> dict[int, Path]:
    """Return the mesh files of a terrain by rock, with the ground (`NO_ROCK`) first."""
    ground = Path(folder) / obj.ground_name(terrain)
    if not ground.exists():
        raise FormatError("the ground mesh is missing", path=ground)
    return {NO_ROCK: ground, **obj.rock_files(folder)}


def terrain_of_folder(folder: str | Path) -> Terrain:
    """Return the terrain in a folder of meshes, from the file name of the ground mesh."""
    grounds = sorted(existing_folder(folder).glob(obj.GROUND_PATTERN))
    if len(grounds) != 1:
        names = ", ".join(path.name for path in grounds) or "none"
        raise FormatError(f"expected a single ground mesh, {obj.GROUND_PATTERN}; found {names}", path=folder)
    terrain = parse_terrain(grounds[0].name.removeprefix("terrain").removesuffix("_ground.obj"))
    if obj.ground_name(terrain) != grounds[0].name:
        raise FormatError(f"{grounds[0].name}, expected the name {obj.ground_name(terrain)}", path=folder)
    return terrain


@reader("mesh table")
def mesh_origins(folder: str | Path) -> dict[str, str]:
    """Read the origin of each mesh by file name: `scan`, `published`, `fitted` or `photos`; empty without a table."""
    path = Path(folder) / MESH_TABLE
    if not path.exists():
        return {}
    table = tables.read_csv(path, ["mesh", "made_from"])
    if table[["mesh", "made_from"]].isna().any(axis=None):
        raise FormatError("a mesh has no origin (column made_from)", path=path)
    return dict(zip(table["mesh"].astype(str), table["made_from"].astype(str), strict=True))


@reader("terrain")
def read_terrain(
    folder: str | Path,
    terrain: Terrain,
    sandbox: Sandbox,
    pool: Executor | None = None,
    cameras: Path | None = None,
) -> TerrainMesh:
    """Read `terrainNN_ground.obj` and every `terrainNN_rock<k>.obj`, in parallel if a pool is given.

    A decimated mesh is read only if the full mesh is missing. The walls are those of `walls.json` in the folder of the
    rig poses `cameras`, fitted to photos, else in the folder of the meshes, measured in scans, else those of the site.
    """
    files = mesh_files(folder, terrain)
    meshes = list((pool.map if pool else map)(obj.read_obj, files.values()))
    whole = join_meshes(meshes)
    rocks = np.repeat(list(files), [len(mesh.faces) for mesh in meshes])
    mesh = TerrainMesh(whole.vertices, whole.faces, rocks)
    file = walls_file(Path(folder), cameras)
    walls = read_walls(file.parent) if file else surveyed_walls(sandbox, mesh.sand_level)
    return replace(mesh if walls is None else _without_ground_behind(mesh, walls), walls=walls)


def _without_ground_behind(mesh: TerrainMesh, walls: Walls) -> TerrainMesh:
    """Return the terrain without faces of the ground that are entirely beyond the middle of a wall.

    Ground behind a wall would be visible below the outer face of the wall, with shadows of rocks on it. Cells up to
    half the thickness of the wall end in the wall.
    """
    (low_x, low_y), (high_x, high_y) = walls.bounds
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    beyond = {"-x": low_x - x, "+x": x - high_x, "-y": low_y - y, "+y": y - high_y}
    hidden = np.zeros(len(mesh.faces), bool)
    for side in walls.sides:
        hidden |= (beyond[side] > THICKNESS_M / 2)[mesh.faces].all(axis=1)
    kept = ~hidden | (mesh.rock_of_face != NO_ROCK)
    return replace(mesh, faces=mesh.faces[kept], rock_of_face=mesh.rock_of_face[kept])


def cameras_of_run(meshes: Path) -> Path | None:
    """Return the folder of the rig poses of the run that a folder `meshes/TerrainTT` is part of; None outside a run."""
    folder = meshes.absolute()
    cameras = folder.parents[1] / "cameras" / folder.name if folder.parent.name == "meshes" else None
    return cameras if cameras is not None and cameras.is_dir() else None

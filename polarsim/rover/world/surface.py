"""World of a drive: a grid of heights, and triangles of rocks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import FormatError
from polarsim.formats import tables
from polarsim.formats.npz import read_arrays, write_arrays
from polarsim.formats.readers import reader
from polarsim.geometry.images import bilinear
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.topology import remove_unused_vertices
from polarsim.geometry.vectors import cross
from polarsim.photo import Terrain

ROCK_COLUMNS = (
    "rock", "terrain", "rock_in_terrain", "x_m", "y_m", "height_m", "width_m", "radius_m", "first_face", "faces",
)  # fmt: skip
AROUND = ("around_x_m", "around_y_m", "around_level_m")  # arrays of `WorldBackdrop` in the files of a world
SCENERY = ("scenery_vertices_m", "scenery_triangles")
RIM = 0.05  # m; distance from a rock's outline at which the height of the ground is measured


@dataclass(frozen=True)
class WorldBackdrop:
    """Ground and rocks outside a world's grid, for rendering only; the resolution decreases with distance.

    x, y : (columns,), (rows,) nodes, m; they contain each node of the grid once.
    level : (rows, columns) float32, m; inside the grid, the heights of the grid are used instead.
    vertices, triangles : (V, 3) float32 and (T, 3) int32 of rocks without a row in the world's table.
    """

    x: np.ndarray
    y: np.ndarray
    level: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray

    def height_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return heights by bilinear interpolation; outside the nodes, those of the edge."""
        column, row = (np.interp(at, nodes, np.arange(len(nodes))) for at, nodes in ((x, self.x), (y, self.y)))
        return bilinear(self.level, column, row)


@dataclass(frozen=True)
class World:
    """World frame: x east, y north, z up, metres; node [row, column] is at (x0 + column cell, y0 + row cell).

    rocks : a row per rock with `ROCK_COLUMNS`, in order of `rock`; triangles `first_face` to `first_face + faces`.
    vertices : (V, 3) float32.
    triangles : (T, 3) int32.
    around : ground outside the grid; None: pictures show a plane there.
    """

    x0: float
    y0: float
    cell: float
    level: np.ndarray  # (rows, columns), the ground before the drive
    rocks: pd.DataFrame
    vertices: np.ndarray
    triangles: np.ndarray
    around: WorldBackdrop | None = None

    @property
    def x(self) -> np.ndarray:
        return self.x0 + self.cell * np.arange(self.level.shape[1])

    @property
    def y(self) -> np.ndarray:
        return self.y0 + self.cell * np.arange(self.level.shape[0])

    def height_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return heights of the ground by bilinear interpolation; outside the ground, those of the edge."""
        column, row = ((np.asarray(at, float) - start) / self.cell for at, start in ((x, self.x0), (y, self.y0)))
        level = bilinear(self.level, column, row)
        if self.around is None:
            return level
        x, y = np.broadcast_arrays(x, y)
        inside = (x >= self.x[0]) & (x <= self.x[-1]) & (y >= self.y[0]) & (y <= self.y[-1])
        return level if inside.all() else np.where(inside, level, self.around.height_at(x, y))

    @property
    def rocks_on_grid(self) -> pd.DataFrame:
        """Rows of the rocks that overlap the grid and can therefore be touched."""
        x, y, radius = (self.rocks[name].to_numpy(float) for name in ("x_m", "y_m", "radius_m"))
        return self.rocks[self.distance_to_grid(x, y) <= radius]

    def distance_to_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return distances from positions to the grid's rectangle, m; 0 inside."""
        dx, dy = (np.maximum(np.maximum(nodes[0] - at, at - nodes[-1]), 0) for nodes, at in ((self.x, x), (self.y, y)))
        return np.asarray(np.hypot(dx, dy))

    def rock_mesh(self, rock: int) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (v, 3) float64 and triangles (t, 3) of a rock."""
        row = self.rocks[self.rocks["rock"] == rock].iloc[0]
        faces = self.triangles[int(row["first_face"]) : int(row["first_face"]) + int(row["faces"])]
        mesh = remove_unused_vertices(self.vertices, faces)
        return mesh.vertices.astype(float), mesh.faces


def bare_world(level: np.ndarray, cell: float, x0: float, y0: float) -> World:
    """Return a world without rocks."""
    integers = ("rock", "terrain", "rock_in_terrain", "first_face", "faces")
    rocks = pd.DataFrame({name: np.zeros(0, np.int64 if name in integers else float) for name in ROCK_COLUMNS})
    return World(x0, y0, cell, level, rocks, np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))


@dataclass(frozen=True)
class PlacedRock:
    """A rock of a terrain with vertices (v, 3) in the world, m, and faces (f, 3) that point outwards."""

    terrain: Terrain
    rock: int
    points: np.ndarray
    faces: np.ndarray


def with_rocks(world: World, rocks: Iterable[PlacedRock]) -> World:
    """Return the world with these rocks and no others."""
    placed, rows, first = list(rocks), [], 0
    if not placed:
        return world
    for number, rock in enumerate(placed):
        numbers = {"rock": number, "terrain": rock.terrain, "rock_in_terrain": rock.rock}
        rows.append(numbers | _extent(world, rock.points) | {"first_face": first, "faces": len(rock.faces)})
        first += len(rock.faces)
    vertices, triangles = stored_arrays([Mesh(rock.points, rock.faces) for rock in placed])
    return replace(world, rocks=pd.DataFrame(rows, columns=list(ROCK_COLUMNS)), vertices=vertices, triangles=triangles)


def stored_arrays(meshes: Sequence[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) float32 and triangles (t, 3) int32 of any number of meshes, as in the files of a world."""
    whole = join_meshes([Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), *meshes])
    return whole.vertices.astype(np.float32), whole.faces.astype(np.int32)


def _extent(world: World, points: np.ndarray) -> dict[str, float]:
    """Return position, height above the surrounding ground, and width, the largest horizontal extent."""
    centre = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
    arms = points[:, :2] - centre
    angles = np.linspace(0, np.pi, 36, endpoint=False)
    extents = arms @ np.stack([np.cos(angles), np.sin(angles)])
    radius = float(np.hypot(*arms.T).max())
    ring = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    around = world.height_at(centre[0] + (radius + RIM) * np.cos(ring), centre[1] + (radius + RIM) * np.sin(ring))
    return {
        "x_m": float(centre[0]),
        "y_m": float(centre[1]),
        "height_m": float(points[:, 2].max() - np.median(around)),
        "width_m": float((extents.max(axis=0) - extents.min(axis=0)).max()),
        "radius_m": radius,
    }


def outward(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return faces with outward orientation; some published meshes are inside out."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    outwards = (a + b + c) / 3 - (points.min(axis=0) + points.max(axis=0)) / 2
    return faces if float((cross(b - a, c - a) * outwards).sum()) >= 0 else faces[:, ::-1]


def write_world(folder: str | Path, world: World) -> None:
    """Write `ground.npz`, `rocks.parquet` and `rocks.npz`; equal worlds give equal bytes."""
    folder, around = Path(folder), world.around
    ground = {
        "x0_m": np.asarray(world.x0, np.float64),
        "y0_m": np.asarray(world.y0, np.float64),
        "cell_m": np.asarray(world.cell, np.float64),
        "level_m": world.level.astype(np.float64),
    }
    rocks = {"vertices_m": world.vertices.astype(np.float32), "triangles": world.triangles.astype(np.int32)}
    if around is not None:
        ground |= dict(zip(AROUND, (around.x, around.y, around.level.astype(np.float32)), strict=True))
        rocks |= dict(zip(SCENERY, (around.vertices, around.triangles), strict=True))
    write_arrays(folder / "ground.npz", **ground)
    tables.write_parquet(folder / "rocks.parquet", world.rocks[list(ROCK_COLUMNS)])
    write_arrays(folder / "rocks.npz", **rocks)


@reader("world of a drive")
def read_world(folder: str | Path) -> World:
    """Read a world written by `write_world`."""
    folder, around = Path(folder), None
    ground = read_arrays(folder / "ground.npz", ("x0_m", "y0_m", "cell_m", "level_m"))
    rocks = tables.read_parquet(folder / "rocks.parquet", ROCK_COLUMNS)
    mesh = read_arrays(folder / "rocks.npz", ("vertices_m", "triangles"))
    x0, y0, cell = (float(ground[name]) for name in ("x0_m", "y0_m", "cell_m"))
    level = ground["level_m"]
    if AROUND[-1] in ground:
        around = WorldBackdrop(*(ground[name] for name in AROUND), *(mesh[name] for name in SCENERY))
    if level.ndim != 2 or (around and around.level.shape != (len(around.y), len(around.x))):
        raise FormatError("heights do not have a row and a column per node", path=folder / "ground.npz")
    return World(x0, y0, cell, level, rocks, mesh["vertices_m"], mesh["triangles"], around)

"""World of a drive: a grid of heights, and triangles of rocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import FormatError
from polarsim.formats import tables
from polarsim.formats.npz import read_arrays, write_arrays

ROCK_COLUMNS = (
    "rock", "terrain", "rock_in_terrain", "x_m", "y_m", "height_m", "width_m", "radius_m", "first_face", "faces",
)  # fmt: skip


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
        return bilinear(self.level, 0.0, 0.0, 1.0, column, row)


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
        level = bilinear(self.level, self.x0, self.y0, self.cell, x, y)
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
        used, numbers = np.unique(faces, return_inverse=True)
        return self.vertices[used].astype(float), numbers.reshape(faces.shape)


def bilinear(level: np.ndarray, x0: float, y0: float, cell: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return values of a grid by bilinear interpolation; outside the grid, those of the edge."""
    column = np.clip((np.asarray(x, float) - x0) / cell, 0, level.shape[1] - 1)
    row = np.clip((np.asarray(y, float) - y0) / cell, 0, level.shape[0] - 1)
    left, below = np.minimum(column.astype(int), level.shape[1] - 2), np.minimum(row.astype(int), level.shape[0] - 2)
    u, v = column - left, row - below
    lower = level[below, left] * (1 - u) + level[below, left + 1] * u
    upper = level[below + 1, left] * (1 - u) + level[below + 1, left + 1] * u
    return np.asarray(lower * (1 - v) + upper * v)


def no_rocks() -> pd.DataFrame:
    """Return the table of a world without rocks."""
    integers = ("rock", "terrain", "rock_in_terrain", "first_face", "faces")
    return pd.DataFrame({name: np.zeros(0, np.int64 if name in integers else float) for name in ROCK_COLUMNS})


def bare_world(level: np.ndarray, cell: float, x0: float, y0: float) -> World:
    """Return a world without rocks."""
    empty = np.zeros((0, 3))
    return World(x0, y0, cell, level, no_rocks(), empty.astype(np.float32), empty.astype(np.int32))


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
        ground |= {"around_x_m": around.x, "around_y_m": around.y, "around_level_m": around.level.astype(np.float32)}
        rocks |= {"scenery_vertices_m": around.vertices, "scenery_triangles": around.triangles}
    write_arrays(folder / "ground.npz", True, **ground)
    tables.write_parquet(folder / "rocks.parquet", world.rocks[list(ROCK_COLUMNS)])
    write_arrays(folder / "rocks.npz", True, **rocks)


def read_world(folder: str | Path) -> World:
    """Read a world written by `write_world`.

    Raises
    ------
    FormatError
        A file is missing or invalid.
    """
    folder = Path(folder)
    ground = read_arrays(folder / "ground.npz", ("x0_m", "y0_m", "cell_m", "level_m"))
    rocks = tables.read_parquet(folder / "rocks.parquet", ROCK_COLUMNS)
    mesh = read_arrays(folder / "rocks.npz", ("vertices_m", "triangles"))
    if ground["level_m"].ndim != 2:
        raise FormatError(
            f"level_m of shape {ground['level_m'].shape}, expected two dimensions", path=folder / "ground.npz"
        )
    return World(
        float(ground["x0_m"]),
        float(ground["y0_m"]),
        float(ground["cell_m"]),
        ground["level_m"],
        rocks,
        mesh["vertices_m"],
        mesh["triangles"],
        _surroundings(ground, mesh, folder),
    )


def _surroundings(
    ground: Mapping[str, np.ndarray], mesh: Mapping[str, np.ndarray], folder: Path
) -> WorldBackdrop | None:
    """Return the surroundings of a world, or None."""
    if "around_level_m" not in ground:
        return None
    for name, arrays, file in (
        ("around_x_m", ground, "ground.npz"),
        ("around_y_m", ground, "ground.npz"),
        ("scenery_vertices_m", mesh, "rocks.npz"),
        ("scenery_triangles", mesh, "rocks.npz"),
    ):
        if name not in arrays:
            raise FormatError(f"array {name!r} is missing", path=folder / file)
    x, y, level = (ground[f"around_{name}_m"] for name in ("x", "y", "level"))
    if level.shape != (len(y), len(x)):
        raise FormatError(
            f"around_level_m of shape {level.shape}, expected {len(y), len(x)}", path=folder / "ground.npz"
        )
    return WorldBackdrop(x, y, level, mesh["scenery_vertices_m"], mesh["scenery_triangles"])

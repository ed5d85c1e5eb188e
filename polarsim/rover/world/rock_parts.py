"""Convex parts of the rocks of a world, and their file: cut once, since the rocks do not depend on a drive's seed."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, RoverError
from polarsim.formats.npz import read_arrays, write_arrays
from polarsim.formats.readers import reader
from polarsim.rover.world.hulls import convex_parts
from polarsim.rover.world.surface import World

log = logging.getLogger("polarsim")
BOUND_M = 0.005  # m; bound that the manual states, a little above `hulls.DEVIATION_M`
_SAME_M = 1e-6  # m; processors differ by rounding


@dataclass(frozen=True)
class RockPart:
    """A convex part of a rock."""

    rock: int  # number of the rock in the world
    corners: np.ndarray  # (n, 3) m
    deviation_m: float  # maximum distance of the part's surface from the mesh, where it can be reached


def rock_parts(world: World) -> list[RockPart]:
    """Return the convex parts of all rocks on the grid, rock by rock; a rock without volume is an error.

    Rocks whose parts deviate from the mesh by more than `BOUND_M` are reported.
    """
    result = []
    for row in world.rocks_on_grid.to_dict("records"):
        rock, name = int(row["rock"]), f"terrain {row['terrain']}, rock {row['rock_in_terrain']}"
        try:
            parts = convex_parts(*world.rock_mesh(rock))
        except RoverError as error:
            raise RoverError(f"{name}: {error}") from error
        if (worst := max(deviation for _, deviation in parts)) > BOUND_M:
            log.warning(
                "%s: shape in the physics deviates by %.1f mm from the mesh, expected at most %.0f mm",
                name, 1000 * worst, 1000 * BOUND_M,
            )  # fmt: skip
        result += [RockPart(rock, corners, deviation) for corners, deviation in parts]
    return result


def shape_table(parts: Iterable[RockPart]) -> list[dict[str, float]]:
    """Return for each rock its number, `rock`, the number of its `parts`, and the maximum `deviation_m`."""
    shapes: dict[int, dict[str, float]] = {}
    for part in parts:
        shape = shapes.setdefault(part.rock, {"rock": part.rock, "parts": 0, "deviation_m": 0.0})
        shape["parts"] += 1
        shape["deviation_m"] = max(shape["deviation_m"], part.deviation_m)
    return list(shapes.values())


def write_rock_parts(path: Path, parts: Sequence[RockPart], world: World) -> None:
    """Write the convex parts of the rocks of a world, with the numbers that identify the rocks."""
    write_arrays(
        path,
        rocks=_identity(world),
        rock=np.array([part.rock for part in parts], np.int64),
        corners=np.array([len(part.corners) for part in parts], np.int64),
        deviation_m=np.array([part.deviation_m for part in parts], np.float64),
        corners_m=np.concatenate([np.zeros((0, 3)), *(part.corners for part in parts)]),
    )


@reader("convex parts of rocks")
def read_rock_parts(path: Path, world: World) -> list[RockPart]:
    """Read a file of `write_rock_parts`; rocks that are not those of the world are an error."""
    arrays = read_arrays(path, ("rocks", "rock", "corners", "deviation_m", "corners_m"))
    rocks = _identity(world)
    if arrays["rocks"].shape != rocks.shape or not np.allclose(arrays["rocks"], rocks, rtol=0, atol=_SAME_M):
        raise FormatError("its rocks are not those of the meshes and options; delete the file and run again", path=path)
    counts = arrays["corners"].tolist()
    corners = (arrays["corners_m"][end - count : end] for count, end in zip(counts, np.cumsum(counts), strict=True))
    return list(map(RockPart, arrays["rock"].tolist(), corners, arrays["deviation_m"].tolist()))


def _identity(world: World) -> np.ndarray:
    """Return number, faces, position and size of each rock on the grid."""
    return world.rocks_on_grid[["rock", "faces", "x_m", "y_m", "height_m", "width_m", "radius_m"]].to_numpy(float)

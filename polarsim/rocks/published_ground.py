"""A published ground mesh, checked against the rocks that were published with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, about
from polarsim.formats import obj
from polarsim.geometry.casters import caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.vectors import cross
from polarsim.rocks.heights import FloorGrid, filled

WIDEST = 20.0  # metres: the sandbox measures 4, a ground in other units far more
LEAST_FOOT = 0.5  # of a rock's foot, by its points, that must have ground below or above it
MOST_GAP = 0.05  # metres between a rock's foot and the ground, median over rocks: in one frame they meet


def read_ground(path: str | Path, feet: Mapping[int, np.ndarray]) -> Mesh:
    """The mesh of a file, facing up, where it is the ground of these rocks.

    Parameters
    ----------
    feet : rock id -> (n, 3)
        Points of the rocks' rims as published, metres, sandbox frame.

    Raises
    ------
    FormatError
        The mesh cannot be read, is no sandbox in metres, lacks ground at a rock or lies away from the rocks' feet.
    """
    ground = obj.read(path)
    with about(path):
        spans = np.ptp(ground.vertices[:, :2], axis=0)
        if spans.max() > WIDEST:
            raise FormatError(
                f"a ground of {spans[0]:.4g} by {spans[1]:.4g} m, the sandbox measures 4 m: not in metres?"
            )
        _check_feet(ground, feet)
    a, b, c = (ground.vertices[ground.faces[:, k]] for k in range(3))
    faces_down = cross(b - a, c - a)[:, 2].sum() < 0
    return Mesh(ground.vertices, ground.faces[:, ::-1]) if faces_down else ground


def heights_on(grid: FloorGrid, ground: Mesh) -> np.ndarray:
    """(rows, columns) heights of the mesh at the cells' centres, metres; carried on smoothly where it has none."""
    places = grid.places().reshape(-1, 2)
    heights = _heights_at(ground, places).reshape(grid.shape)
    return filled(np.nan_to_num(heights), np.isfinite(heights))


def _check_feet(ground: Mesh, feet: Mapping[int, np.ndarray]) -> None:
    gaps = {rock: points[:, 2] - _heights_at(ground, points) for rock, points in feet.items()}
    bare = [rock for rock, gap in gaps.items() if np.isfinite(gap).mean() < LEAST_FOOT]
    if bare:
        raise FormatError(f"no ground at rock {', '.join(map(str, bare))} of {len(gaps)}: the ground covers all rocks")
    if gaps:
        offs = np.array([np.nanmedian(gap) for gap in gaps.values()])
        if np.median(np.abs(offs)) > MOST_GAP:
            raise FormatError(
                f"the rocks' feet lie {1000 * np.median(offs):+.0f} mm above this ground, median of {len(offs)} "
                f"rocks, {1000 * MOST_GAP:.0f} mm allowed: ground and rocks are not in one frame"
            )


def _heights_at(ground: Mesh, places: np.ndarray) -> np.ndarray:
    """(n,) height of the mesh's upper side at places (n, 2 or 3); NaN beside it."""
    top = ground.vertices[:, 2].max() + 1.0
    origins = np.column_stack([places[:, :2], np.full(len(places), top)])
    distance, _ = caster(ground.vertices, ground.faces).nearest(
        origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    )
    return np.where(np.isfinite(distance), top - distance, np.nan)

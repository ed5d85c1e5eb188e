"""Rocks of a world: rows of the table of rocks, and triangles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from polarsim.geometry.vectors import cross
from polarsim.rover.world.surface import ROCK_COLUMNS, World

RIM = 0.05  # m; distance from a rock's outline at which the height of the ground is measured


@dataclass(frozen=True)
class PlacedRock:
    """A rock of a terrain with vertices (v, 3) in the world, m, and faces (f, 3) that point outwards."""

    terrain: int
    rock: int
    points: np.ndarray
    faces: np.ndarray


def with_rocks(world: World, rocks: Iterable[PlacedRock]) -> World:
    """Return the world with these rocks and no others."""
    rows: list[dict[str, float | int]] = []
    vertices: list[np.ndarray] = []
    triangles: list[np.ndarray] = []
    corner, first = 0, 0
    for rock in rocks:
        rows.append(
            {
                "rock": len(rows),
                "terrain": rock.terrain,
                "rock_in_terrain": rock.rock,
                **world_rock_row(world, rock.points),
            }
            | {"first_face": first, "faces": len(rock.faces)}
        )
        vertices.append(rock.points)
        triangles.append(rock.faces + corner)
        corner, first = corner + len(rock.points), first + len(rock.faces)
    if not rows:
        return world
    table = pd.DataFrame(rows, columns=list(ROCK_COLUMNS))
    corners = np.concatenate(vertices).astype(np.float32)
    return replace(world, rocks=table, vertices=corners, triangles=np.concatenate(triangles).astype(np.int32))


def world_rock_row(world: World, points: np.ndarray) -> dict[str, float]:
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

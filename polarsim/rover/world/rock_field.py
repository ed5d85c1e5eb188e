"""Rocks strewn over a square: how many of which size, where, and which of a run's rocks lends its shape.

Numbers: rocks of diameter D or more cover the share k exp(-q D) of the ground, q = 1.79 + 0.152 / k (per metre); k is
the share that all rocks cover (Golombek & Rapp, J. Geophys. Res. 102 (1997) 4117, fitted to Viking's sites and rocky
ground on Earth). With an outline of pi D^2 / 4 a rock, that is N(D) = 4 k q / pi E2(q D) / D rocks on a square metre,
E2 being the exponential integral of order 2.

Shapes are scaled so that the outline seen from above has the area of a circle of diameter D, and turned about the
vertical; they lie as deep in the ground as they did.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull
from scipy.special import expn

from polarsim.errors import RoverError
from polarsim.geometry.meshes import Mesh, subdivided
from polarsim.geometry.topology import hull_faces
from polarsim.randomness import generator
from polarsim.rover.world.hulls import top_at
from polarsim.rover.world.placed import outward
from polarsim.rover.world.stitch import Terrain

_TRIES = 50  # places for a rock before it may overlap another
_FACET_M = 0.02  # of near rocks' triangles: with larger ones black corners show where light grazes
_MOST_FACES = 50_000
_SIZES = 2000  # at which the law is tabulated to draw from it
_RING = np.linspace(0, 2 * np.pi, 24, endpoint=False)
RING_RADII = 0.65  # diameters from a rock's centre at which the ground round it is measured


@dataclass(frozen=True)
class RockLaw:
    """Which rocks are strewn."""

    abundance: float = 0.02  # k of Golombek and Rapp's law, whose rocks below `smallest_m` are left out
    smallest_m: float = 0.05
    largest_m: float = 1.0
    clear_m: float = 1.5  # minimum distance of a rock from where the rover starts


@dataclass(frozen=True)
class Shape:
    """A rock of a terrain in units of its diameter: centre at x = y = 0, ground at z = 0; a mesh a level of detail."""

    terrain: int
    rock: int
    diameter_m: float  # of the rock as it was
    levels: tuple[Mesh, ...]  # finest first


@dataclass(frozen=True)
class RockField:
    """n rocks, largest first: centres and diameters, m, angles by which they are turned, rad, and indices of shapes."""

    x: np.ndarray
    y: np.ndarray
    diameter: np.ndarray
    angle: np.ndarray
    shape: np.ndarray


def per_m2(diameter_m: np.ndarray | float, abundance: float) -> np.ndarray:
    """Rocks of this diameter or more on a square metre."""
    diameter, q = np.asarray(diameter_m, float), _steepness(abundance)
    return np.asarray(4 * abundance * q / np.pi * expn(2, q * diameter) / diameter)


def _steepness(abundance: float) -> float:
    return 1.79 + 0.152 / abundance


def strewn_rocks(law: RockLaw, shapes: list[Shape], size_m: float, clear: np.ndarray, seed: int) -> RockField:
    """Rocks with centres on a square of side `size_m` about 0, none nearer than `clear_m` to places `clear` (n, 2)."""
    rng = generator(seed, "rocks")
    sizes = np.geomspace(law.smallest_m, law.largest_m, _SIZES)
    density = per_m2(sizes, law.abundance)
    count = rng.poisson(size_m**2 * (density[0] - density[-1])) if shapes else 0
    diameter = np.interp(-np.sort(rng.uniform(density[-1], density[0], count)), -density, sizes)
    diameter = np.sort(diameter)[::-1]
    x, y = _places(rng, diameter, size_m, clear, law.clear_m)
    own = np.array([shape.diameter_m for shape in shapes])
    order = np.argsort(-own)
    # A large rock takes its shape from the larger half of the rocks: the small ones' meshes show less.
    coarse = len(order) - (len(order) // 2) * (diameter > np.median(own) if len(own) else 0)
    shape = order[rng.integers(0, coarse, count)] if count else np.zeros(0, int)
    return RockField(x, y, diameter, rng.uniform(0, 2 * np.pi, count), shape)


def _places(
    rng: np.random.Generator, diameter: np.ndarray, size_m: float, clear: np.ndarray, clear_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) centres so that no rock overlaps a larger one, where there is room."""
    x, y = np.empty(len(diameter)), np.empty(len(diameter))
    for number, own in enumerate(diameter):
        for _ in range(_TRIES):
            x[number], y[number] = rng.uniform(-size_m / 2, size_m / 2, 2)
            away = np.hypot(x[:number] - x[number], y[:number] - y[number])
            open_ = np.hypot(*(clear - [x[number], y[number]]).T) > clear_m + own / 2
            if open_.all() and (away > (diameter[:number] + own) / 2).all():
                break
    return x, y


def shapes_of(terrains: list[Terrain], corners: tuple[int, ...]) -> list[Shape]:
    """The rocks of terrains as shapes: each as it is, and as a hull of at most so many corners for every further level.

    Raises
    ------
    RoverError
        There is no rock.
    """
    shapes = [shape for terrain in terrains for shape in _shapes(terrain, corners)]
    if not shapes:
        names = ", ".join(str(terrain.number) for terrain in terrains)
        raise RoverError(f"rover.world.dem.rocks: the meshes of terrains {names} have no rock to take a shape from")
    return shapes


def _shapes(terrain: Terrain, corners: tuple[int, ...]) -> list[Shape]:
    used = {number: np.unique(rock.faces, return_inverse=True) for number, rock in sorted(terrain.rocks.items())}
    points = {number: terrain.rocks[number].vertices[own] for number, (own, _) in used.items()}
    feet = _feet(terrain, list(points.values()))
    found = []
    for (number, (_, faces)), foot in zip(used.items(), feet, strict=True):
        own, faces = points[number] - foot, faces.reshape(-1, 3)
        diameter = _diameter(own, faces)
        mesh = Mesh(own / diameter, outward(own, faces))
        found.append(Shape(terrain.number, number, diameter, (mesh, *(_fewer(mesh, most) for most in corners))))
    return found


def _feet(terrain: Terrain, rocks: list[np.ndarray]) -> np.ndarray:
    """(n, 3) centres of rocks, vertices (v, 3) each, at the height of the ground round them."""
    centres = np.array([(points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2 for points in rocks]).reshape(-1, 2)
    reach = [np.hypot(*(points[:, :2] - centre).T).max() for points, centre in zip(rocks, centres, strict=True)]
    directions = np.stack([np.cos(_RING), np.sin(_RING)], axis=1)
    rings = centres[:, None] + 2 * RING_RADII * np.reshape(reach, (-1, 1, 1)) * directions
    top = top_at(terrain.ground.vertices, terrain.ground.faces, rings[..., 0].ravel(), rings[..., 1].ravel())
    top = np.where(np.isfinite(top), top, terrain.sand_level).reshape(len(rocks), len(_RING))
    return np.column_stack([centres, np.median(top, axis=1)])


def _diameter(points: np.ndarray, faces: np.ndarray) -> float:
    """Of the circle with the area of the outline from above, of what is above the ground if there is enough of it."""
    start, end = (points[faces[:, sides].ravel()] for sides in ([0, 1, 2], [1, 2, 0]))
    through = start[:, 2] * end[:, 2] < 0
    start, end = start[through], end[through]
    foot = start + (end - start) * (start[:, 2] / (start[:, 2] - end[:, 2]))[:, None]
    above = np.concatenate([points[points[:, 2] > 0], foot])
    return float(np.sqrt(4 * ConvexHull((above if len(above) > 8 else points)[:, :2]).volume / np.pi))


def _fewer(mesh: Mesh, corners: int) -> Mesh:
    """The hull of the vertices that lie farthest out in so many directions, spread evenly (a Fibonacci spiral)."""
    number = np.arange(corners) + 0.5
    z, turn = 1 - 2 * number / corners, np.pi * (1 + np.sqrt(5)) * number
    flat = np.sqrt(1 - z**2)
    directions = np.stack([flat * np.cos(turn), flat * np.sin(turn), z])
    points = mesh.vertices[np.unique((mesh.vertices @ directions).argmax(axis=0))]
    return Mesh(points, hull_faces(points))


def smooth(mesh: Mesh, diameter_m: float) -> Mesh:
    """A shape with more triangles, where it is so large in the world that a camera near it would show them."""
    edges = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    facet_m = diameter_m * float(np.median(np.linalg.norm(edges, axis=2)))
    while facet_m > _FACET_M and 4 * len(mesh.faces) <= _MOST_FACES:
        mesh, facet_m = subdivided(mesh), facet_m / 2
    return mesh


def posed(mesh: Mesh, diameter_m: float, angle: float, foot: np.ndarray) -> np.ndarray:
    """(v, 3) a shape's vertices in the world, m; `foot` (3,): where its centre meets the ground."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = mesh.vertices @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return np.asarray(diameter_m * turned + foot)

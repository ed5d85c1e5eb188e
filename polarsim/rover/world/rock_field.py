"""Random rocks on a square: number, sizes, positions, and shapes from rocks of a run.

Number: rocks of diameter D or more cover the share k exp(-q D) of the ground, q = 1.79 + 0.152 / k (per metre); k is
the share that all rocks cover (Golombek & Rapp, J. Geophys. Res. 102 (1997) 4117, fitted to Viking's sites and rocky
ground on Earth). With an outline of pi D^2 / 4 per rock, that is N(D) = 4 k q / pi E2(q D) / D rocks per square metre,
where E2 is the exponential integral of order 2.

Shapes are scaled so that the horizontal outline has the area of a circle of diameter D, and rotated about the vertical.
The relative depth of burial is unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull
from scipy.special import expn

from polarsim.errors import RoverError
from polarsim.geometry.meshes import Mesh, subdivide_smoothly
from polarsim.geometry.outlines import spread_directions
from polarsim.geometry.topology import hull_faces, remove_unused_vertices
from polarsim.photo import Terrain
from polarsim.randomness import generator
from polarsim.rover.world.mesh_heights import top_at
from polarsim.rover.world.stitch import TerrainSolids
from polarsim.rover.world.surface import outward

SMALLEST_M, LARGEST_M = 0.05, 1.0  # m; range of diameters
CLEAR_M = 1.5  # minimum distance of a rock from the start
_TRIES = 50  # attempts to place a rock without overlap
_FACET_M = 0.02  # maximum facet of near rocks: larger facets show black corners in grazing light
_MOST_FACES = 50_000
_SIZES = 2000  # number of tabulated sizes of the law
_RING = np.linspace(0, 2 * np.pi, 24, endpoint=False)
RING_RADII = 0.65  # distance from a rock's centre, in diameters, at which the height of the ground is measured


@dataclass(frozen=True)
class RockModel:
    """A rock in units of its diameter: centre at x = y = 0, ground at z = 0; a mesh per level of detail."""

    terrain: Terrain
    rock: int
    diameter_m: float  # diameter of the original rock
    levels: tuple[Mesh, ...]  # in descending order of detail


@dataclass(frozen=True)
class RockField:
    """n rocks in descending order of size: centres and diameters, m, rotation angles, rad, and indices of shapes."""

    x: np.ndarray
    y: np.ndarray
    diameter: np.ndarray
    angle: np.ndarray
    shape: np.ndarray


def rocks_per_m2(diameter_m: np.ndarray | float, abundance: float) -> np.ndarray:
    """Return the number of rocks of at least this diameter per square metre."""
    diameter, q = np.asarray(diameter_m, float), 1.79 + 0.152 / abundance
    return np.asarray(4 * abundance * q / np.pi * expn(2, q * diameter) / diameter)


def random_rocks(abundance: float, shapes: list[RockModel], size_m: float, clear: np.ndarray, seed: int) -> RockField:
    """Return rocks that cover the share `abundance`, with centres on a square of side `size_m` about the origin.

    No rock is closer than `CLEAR_M` to the positions `clear` (n, 2).
    """
    rng = generator(seed, "rocks")
    sizes = np.geomspace(SMALLEST_M, LARGEST_M, _SIZES)
    density = rocks_per_m2(sizes, abundance)
    count = rng.poisson(size_m**2 * (density[0] - density[-1])) if shapes else 0
    diameter = np.interp(-np.sort(rng.uniform(density[-1], density[0], count)), -density, sizes)
    diameter = np.sort(diameter)[::-1]
    x, y = _places(rng, diameter, size_m, clear)
    shape_diameter = np.array([shape.diameter_m for shape in shapes])
    order = np.argsort(-shape_diameter)
    # Large rocks use the shapes of the larger half of the rocks, since meshes of small rocks have less detail.
    coarse = len(order) - (len(order) // 2) * (diameter > np.median(shape_diameter) if len(order) else 0)
    shape = order[rng.integers(0, coarse, count)] if count else np.zeros(0, int)
    return RockField(x, y, diameter, rng.uniform(0, 2 * np.pi, count), shape)


def _places(
    rng: np.random.Generator, diameter: np.ndarray, size_m: float, clear: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (n,) centres such that no rock overlaps a larger rock, if there is room."""
    x, y = np.empty(len(diameter)), np.empty(len(diameter))
    for number, size in enumerate(diameter):
        for _ in range(_TRIES):
            x[number], y[number] = rng.uniform(-size_m / 2, size_m / 2, 2)
            distance = np.hypot(x[:number] - x[number], y[:number] - y[number])
            open_ = np.hypot(*(clear - [x[number], y[number]]).T) > CLEAR_M + size / 2
            if open_.all() and (distance > (diameter[:number] + size) / 2).all():
                break
    return x, y


def rock_shapes(terrains: list[TerrainSolids], corners: tuple[int, ...]) -> list[RockModel]:
    """Return the rocks of terrains as shapes: the original mesh, and a hull for each maximum number of vertices."""
    shapes = [shape for terrain in terrains for shape in _shapes(terrain, corners)]
    if not shapes:
        names = ", ".join(str(terrain.number) for terrain in terrains)
        raise RoverError(f"rover.world.dem.rocks: the meshes of terrains {names} contain no rock")
    return shapes


def _shapes(terrain: TerrainSolids, corners: tuple[int, ...]) -> list[RockModel]:
    rocks = {number: remove_unused_vertices(rock.vertices, rock.faces) for number, rock in terrain.rocks.items()}
    numbers = sorted(rocks)
    result = []
    for number, foot in zip(numbers, _feet(terrain, [rocks[each].vertices for each in numbers]), strict=True):
        local, faces = rocks[number].vertices - foot, rocks[number].faces
        diameter = _diameter(local, faces)
        mesh = Mesh(local / diameter, outward(local, faces))
        result.append(RockModel(terrain.number, number, diameter, (mesh, *(_fewer(mesh, most) for most in corners))))
    return result


def _feet(terrain: TerrainSolids, rocks: list[np.ndarray]) -> np.ndarray:
    """Return (n, 3) centres of rocks, vertices (v, 3) each, at the height of the surrounding ground."""
    centres = np.array([(points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2 for points in rocks]).reshape(-1, 2)
    reach = [np.hypot(*(points[:, :2] - centre).T).max() for points, centre in zip(rocks, centres, strict=True)]
    directions = np.stack([np.cos(_RING), np.sin(_RING)], axis=1)
    rings = centres[:, None] + 2 * RING_RADII * np.reshape(reach, (-1, 1, 1)) * directions
    top = top_at(terrain.ground.vertices, terrain.ground.faces, rings[..., 0].ravel(), rings[..., 1].ravel())
    top = np.where(np.isfinite(top), top, terrain.sand_level).reshape(len(rocks), len(_RING))
    return np.column_stack([centres, np.median(top, axis=1)])


def _diameter(points: np.ndarray, faces: np.ndarray) -> float:
    """Return the diameter of a circle with the area of the outline, above the ground if enough vertices are there."""
    start, end = (points[faces[:, sides].ravel()] for sides in ([0, 1, 2], [1, 2, 0]))
    through = start[:, 2] * end[:, 2] < 0
    start, end = start[through], end[through]
    foot = start + (end - start) * (start[:, 2] / (start[:, 2] - end[:, 2]))[:, None]
    above = np.concatenate([points[points[:, 2] > 0], foot])
    return float(np.sqrt(4 * ConvexHull((above if len(above) > 8 else points)[:, :2]).volume / np.pi))


def _fewer(mesh: Mesh, corners: int) -> Mesh:
    """Return the hull of the extreme vertices in evenly distributed directions."""
    points = mesh.vertices[np.unique((mesh.vertices @ spread_directions(corners).T).argmax(axis=0))]
    return Mesh(points, hull_faces(points))


def smooth(mesh: Mesh, diameter_m: float) -> Mesh:
    """Return a shape with more triangles if it is so large that a near camera would show the facets."""
    edges = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    facet_m = diameter_m * float(np.median(np.linalg.norm(edges, axis=2)))
    while facet_m > _FACET_M and 4 * len(mesh.faces) <= _MOST_FACES:
        mesh, facet_m = subdivide_smoothly(mesh), facet_m / 2
    return mesh


def vertices_in_world(mesh: Mesh, diameter_m: float, angle: float, foot: np.ndarray) -> np.ndarray:
    """Return the vertices (v, 3) of a shape in the world, m; `foot` (3,): position of its origin."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = mesh.vertices @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return np.asarray(diameter_m * turned + foot)

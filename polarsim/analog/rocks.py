"""Angular rocks: random polyhedra with chipped corners and rough faces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.geometry.outlines import spread_directions


@dataclass(frozen=True)
class SimulatedRock:
    """A placed rock, sandbox frame."""

    rock: int
    vertices: np.ndarray  # (v, 3) in the topology of the icosphere
    albedo: float
    gloss: float  # strength of the glossy lobe
    patch: float  # relative additional brightness of fresh faces

    def moved(self, by: np.ndarray) -> SimulatedRock:
        return replace(self, vertices=self.vertices + by)

    @property
    def centre(self) -> np.ndarray:
        return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2

    @property
    def detail(self) -> int:
        """Number of subdivisions of the icosphere."""
        return round(np.log2((len(self.vertices) - 2) / 10) / 2)

    @property
    def radius(self) -> float:
        """Mean horizontal radius, metres."""
        extent = np.ptp(self.vertices, axis=0)
        return float(extent[0] + extent[1]) / 4


@cache
def icosphere(detail: int) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (v, 3) and faces (f, 3); the vertices of coarser spheres are first."""
    golden = (1 + 5**0.5) / 2
    corners = [[-1, golden, 0], [1, golden, 0], [-1, -golden, 0], [1, -golden, 0]]
    vertices = np.array([np.roll(corner, step) for step in (0, 1, 2) for corner in corners], float)
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    edge = np.sort(np.linalg.norm(vertices[:, None] - vertices[None], axis=-1).ravel())[12]
    near = np.abs(np.linalg.norm(vertices[:, None] - vertices[None], axis=-1) - edge) < 1e-6
    faces = np.array(
        [(a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c] and near[a, c]]
    )
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    for _ in range(detail):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        centre = vertices[unique].sum(axis=1)
        ab, bc, ca = np.split(index.ravel() + len(vertices), 3)
        vertices = np.concatenate([vertices, centre / np.linalg.norm(centre, axis=1, keepdims=True)])
        a, b, c = faces.T
        faces = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return vertices, faces


def carve(rng: np.random.Generator, rock: int, size: float, detail: int) -> SimulatedRock:
    """Generate a rock with longest side `size`, metres, centred at the origin, approximately on a broad side.

    Random planes cut a sphere to a polyhedron, additional planes cut corners off, and noise adds roughness.
    """
    directions, _ = icosphere(detail)
    normals = _jittered_directions(rng, int(rng.integers(11, 19)))
    radius = _cut(directions, normals, rng.uniform(0.70, 1.0, len(normals)))
    for _ in range(int(rng.integers(3, 7))):  # chips: planes just inside the farthest corners
        towards = directions[rng.choice(np.argsort(radius)[-len(radius) // 5 :])] + rng.normal(0, 0.25, 3)
        towards /= np.linalg.norm(towards)
        reach = (directions @ towards * radius).max()
        radius = np.minimum(radius, _cut(directions, towards[None], np.array([reach * rng.uniform(0.82, 0.94)])))
    stretch = np.array([1.0, rng.uniform(0.62, 0.95), rng.uniform(0.45, 0.80)])
    points = directions * radius[:, None] * stretch
    lumps = _octaves(rng, points, (1.5, 3.0), 1.0)
    rough = _octaves(rng, points, (6.0, 12.0, 24.0), 0.8)
    pitted = -np.clip(_octaves(rng, points, (9.0,), 0.0) - 1.0, 0, 1)  # vesicles
    points *= (1 + 0.05 * lumps + rng.uniform(0.03, 0.10) * rough + rng.uniform(0, 0.05) * pitted)[:, None]
    tilt = Rotation.from_rotvec(rng.normal(0, 0.25, 3) * [1, 1, 0])
    rotated = (Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)]) * tilt).apply(points)
    rotated -= (rotated.min(axis=0) + rotated.max(axis=0)) / 2
    rotated *= size / np.ptp(rotated, axis=0).max()
    bright = rng.random() < 0.2
    return SimulatedRock(
        rock, rotated, float(rng.uniform(0.14, 0.36)), float(rng.uniform(0.1, 0.5)) if bright else 0.02,
        float(rng.uniform(0.5, 1.2)) if bright else float(rng.uniform(0, 0.3)),
    )  # fmt: skip


def _cut(directions: np.ndarray, normals: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """Return the distance (n,) from the origin to the nearest plane along each direction."""
    along = directions @ normals.T
    with np.errstate(divide="ignore"):
        return np.where(along > 1e-3, distances / along, np.inf).min(axis=1)


def _jittered_directions(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return unit vectors (count, 3) that cover all sides (a jittered, randomly rotated Fibonacci lattice)."""
    lattice = spread_directions(count)
    lattice += rng.normal(0, 0.22, lattice.shape)
    lattice /= np.linalg.norm(lattice, axis=1, keepdims=True)
    return Rotation.from_rotvec(rng.normal(0, 2, 3)).apply(lattice)


def _lattice_noise(points: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return smooth noise (n,) at points (n, 3) in lattice steps, interpolated from a periodic table (m, m, m)."""
    size = len(table)
    floor = np.floor(points)
    fraction = points - floor
    fraction = fraction * fraction * (3 - 2 * fraction)
    low = floor.astype(int) % size
    high = (low + 1) % size
    total = np.zeros(len(points))
    for corner in range(8):
        bits = [(corner >> axis) & 1 for axis in range(3)]
        index = [(high if bit else low)[:, axis] for axis, bit in enumerate(bits)]
        weight = np.prod([fraction[:, a] if bit else 1 - fraction[:, a] for a, bit in enumerate(bits)], axis=0)
        total += weight * table[index[0], index[1], index[2]]
    return total


def _octaves(rng: np.random.Generator, points: np.ndarray, cells: tuple[float, ...], falloff: float) -> np.ndarray:
    """Return the sum (n,) of lattice noises at points (n, 3) with `cells` steps per unit; amplitudes cells^-falloff."""
    total = np.zeros(len(points))
    for count in cells:
        table = rng.standard_normal((32, 32, 32))
        total += count**-falloff * _lattice_noise(points * count + rng.uniform(0, 32, 3), table)
    return total

"""Indirect light of one diffuse reflection, computed at selected vertices and interpolated to all vertices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from polarsim.analog.light import BEFORE_LAMP, SURFACE_OFFSET, DiscLamp, towards
from polarsim.analog.rays import RayCaster, lengths
from polarsim.analog.rocks import icosphere
from polarsim.analog.sandbox import HALL_OBJECT, SandboxScene
from polarsim.analog.view import GBuffer, pixels, strips
from polarsim.geometry.outlines import spread_directions

AMBIENT = "ambient"  # weak ambient light of the hall, in addition to the lamps
_CACHE_GRID = 0.06  # step of the ground points at which indirect light is computed, metres
_CACHE_ROCK_DETAIL = 2
_BOUNCE_RAYS = 36


@dataclass(frozen=True)
class Bounce:
    """Indirect light vector at every vertex; the component along the normal is the irradiance."""

    vectors: dict[str, np.ndarray]  # lamp -> (v, 3) float32

    def at(self, scene: SandboxScene, view: GBuffer, lamps: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the indirect radiance (h, w) of a view by lamp."""
        vectors = np.stack(
            [self.vectors[lamp] for lamp in lamps], axis=1
        )  # (v, n, 3): a single look-up per corner for all lamps
        out = {lamp: np.zeros(view.shape, np.float32) for lamp in lamps}
        for rows in strips(len(view.faces), 32):  # smaller parts than elsewhere: a vector per lamp and corner
            corners = scene.faces[view.faces[rows]]
            second, third = view.weights[rows][..., :1, None], view.weights[rows][..., 1:, None]
            vector = vectors[corners[..., 0]] * (1 - second - third)
            vector += vectors[corners[..., 1]] * second
            vector += vectors[corners[..., 2]] * third
            along = np.einsum("...nk,...k->...n", vector, view.normals[rows])
            floor = np.float32(0.1) * lengths(vector)  # light also arrives from other directions
            radiance = view.albedo[rows][..., None] / np.float32(np.pi) * np.maximum(along, floor)
            for number, lamp in enumerate(lamps):
                out[lamp][rows] = radiance[..., number]
        return out


def gather_bounce(
    scene: SandboxScene, caster: RayCaster, lamps: Mapping[str, DiscLamp], rng: np.random.Generator
) -> Bounce:
    """Compute the light of one diffuse reflection and of the hall at selected vertices; interpolate to all vertices."""
    chosen = _chosen_vertices(scene)
    points, normals = scene.vertices[chosen], scene.normals[chosen]
    directions = _hemisphere(normals, rng)
    origins = (points + SURFACE_OFFSET * normals)[:, None]
    hit = caster.first_hits(origins, directions)
    is_hit = hit.is_hit & (hit.distance > 0)
    face = np.where(is_hit, hit.face, 0)
    distance = np.where(is_hit, hit.distance, np.float32(1))
    where = origins + distance[..., None] * directions
    facing = scene.normals[scene.faces[face, 0]]
    facing = np.where(np.einsum("...k,...k->...", facing, directions)[..., None] > 0, -facing, facing)
    weight = np.float32(2 * np.pi / _BOUNCE_RAYS)
    vectors = {}
    similar = _similar_neighbours(scene, chosen[chosen >= scene.first_vertex[HALL_OBJECT]])
    for name, lamp in lamps.items():
        lit = _lit_radiance(scene, caster, lamp, where, facing, face) * is_hit
        vectors[name] = _interpolate(scene, chosen, weight * np.einsum("nk,nkx->nx", lit, directions), similar)
    from_hall = ((scene.object_of_face[face] == HALL_OBJECT) | ~is_hit).astype(np.float32)
    vectors[AMBIENT] = _interpolate(scene, chosen, weight * np.einsum("nk,nkx->nx", from_hall, directions), similar)
    return Bounce(vectors)


def _lit_radiance(
    scene: SandboxScene,
    caster: RayCaster,
    lamp: DiscLamp,
    points: np.ndarray,
    normals: np.ndarray,
    face: np.ndarray,
) -> np.ndarray:
    """Return the radiance of diffuse surfaces under a lamp, with hard shadows."""
    to_lamp, distance = towards(lamp, points)
    cosine = np.einsum("...k,...k->...", normals, to_lamp)
    lit = cosine > 0
    start = pixels(points + SURFACE_OFFSET * normals, np.flatnonzero(lit))
    lit[lit] = ~caster.occluded(start, (lamp.position - start).astype(np.float32), BEFORE_LAMP)
    radiance = scene.albedo_of_face[face] / np.float32(np.pi) * cosine * lamp.irradiance(to_lamp, distance)
    return np.where(lit, radiance, 0).astype(np.float32)


def _hemisphere(normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return directions (n, rays, 3) float32, uniform over hemispheres: a fixed set, rotated at random."""
    sphere = spread_directions(2 * _BOUNCE_RAYS)[:_BOUNCE_RAYS]
    angle = rng.uniform(0, 2 * np.pi, len(normals))
    side = np.where(np.abs(normals[:, 2:]) < 0.9, [[0, 0, 1.0]], [[1.0, 0, 0]])
    first = np.cross(normals, side)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    right = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    ahead = np.cross(normals, right)
    frame = np.stack([right, ahead, normals], axis=1)
    return np.einsum("rk,nkx->nrx", sphere, frame).astype(np.float32)


def _cache_stride(scene: SandboxScene) -> int:
    return max(1, round(_CACHE_GRID / scene.ground.steps[0]))


def _chosen_vertices(scene: SandboxScene) -> np.ndarray:
    """Return the vertices at which indirect light is computed: a coarse ground grid, some of each rock, all others."""
    shape, stride = scene.ground.heights.shape, _cache_stride(scene)
    grid = np.arange(scene.ground.heights.size).reshape(shape)[::stride, ::stride].ravel()
    few = len(icosphere(_CACHE_ROCK_DETAIL)[0])
    rocks = [scene.first_vertex[rock.rock] + np.arange(few) for rock in scene.rocks]
    rest = np.arange(scene.first_vertex[HALL_OBJECT], len(scene.vertices))
    return np.concatenate([grid, *rocks, rest])


def _similar_neighbours(scene: SandboxScene, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and indices (n, 16) of the neighbours of vertices (n,) with similar position and normal."""
    features = np.concatenate([scene.vertices[rest], 0.2 * scene.normals[rest]], axis=1)
    distance, near = cKDTree(features).query(features, k=16)
    weights = np.exp(-((np.asarray(distance) / 0.15) ** 2))
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32), np.asarray(near)


@cache
def _from_coarse(detail: int) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and numbers (v, 4) of the coarse-sphere vertices nearest to each vertex of a finer sphere."""
    few = len(icosphere(_CACHE_ROCK_DETAIL)[0])
    sphere = icosphere(detail)[0]
    distance, near = cKDTree(sphere[:few]).query(sphere, k=4)
    weights = 1 / (np.asarray(distance) + 0.05)
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32), np.asarray(near)


def _interpolate(
    scene: SandboxScene, chosen: np.ndarray, vectors: np.ndarray, similar: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Interpolate light vectors at the chosen vertices to all vertices (v, 3)."""
    import cv2

    out = np.zeros((len(scene.vertices), 3), np.float32)
    shape, stride = scene.ground.heights.shape, _cache_stride(scene)
    nodes = tuple(len(range(0, size, stride)) for size in shape)
    start, few = nodes[0] * nodes[1], len(icosphere(_CACHE_ROCK_DETAIL)[0])
    coarse = vectors[:start].reshape(*nodes, 3)
    coarse = gaussian_filter(coarse, (0.8, 0.8, 0)).astype(np.float32)
    rows, columns = np.meshgrid(*(np.arange(size, dtype=np.float32) / stride for size in shape), indexing="ij")
    at_nodes = cv2.remap(coarse, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    out[: scene.ground.heights.size] = at_nodes.reshape(-1, 3)
    for rock in scene.rocks:
        weights, near = _from_coarse(rock.detail)
        first = scene.first_vertex[rock.rock]
        out[first : first + len(near)] = np.einsum("nk,nkx->nx", weights, vectors[start : start + few][near])
        start += few
    weights, near = similar
    out[chosen[start:]] = np.einsum("nk,nkx->nx", weights, vectors[start:][near])
    return out

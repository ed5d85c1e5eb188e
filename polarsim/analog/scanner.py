"""Laser scanner: ranges on an angular grid with realistic errors, and range maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.analog.options import AnalogOptions
from polarsim.analog.rays import RayCaster, grid_faces
from polarsim.analog.sandbox import SandboxScene
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.poses import Pose

_PAN, _TILT_UP, _TILT_DOWN = np.radians([36.0, 3.0, 48.0])  # angular window around the heading and the horizon
_REGISTRATION_MM, _REGISTRATION_DEG = 2.0, 0.05  # standard deviation of the registration of a scan
_MAX_RANGE_M = 9.0  # maximum range of the scanner: the rear end of the hall has no points
_EDGE = 0.03  # metres: larger range differences between neighbours are depth edges
_GAP = 0.05  # metres: neighbours are not joined if the difference exceeds this and _GAP_SHARE of the range
_GAP_SHARE = 0.02
_STEP_M = 1e-4  # resolution of ranges in NASA's files, much smaller than the range noise
_WHITE_AT_M = 3.0  # distance at which ...
_WHITE = 120  # ... a white surface at normal incidence returns this intensity: about the middle of 0 to 255
_INTENSITY_SD = 3.0  # standard deviation of the intensity, hides the rounding steps


@dataclass(frozen=True)
class Scan:
    """Points on the angular grid (rows, columns), sandbox frame; NaN without return."""

    points: np.ndarray  # (rows, columns, 3)
    intensity: np.ndarray  # (rows, columns) 0..255


def scan(
    scene: SandboxScene,
    caster: RayCaster,
    sandbox_from_scanner: Pose,
    rng: np.random.Generator,
    options: AnalogOptions,
) -> Scan:
    """Scan the angular window from the pose of the upright scanner frame: x ahead, y left, z up."""
    step = np.radians(options.scan_step_deg)
    pan, tilt = np.arange(-_PAN, _PAN, step), np.arange(_TILT_UP, -_TILT_DOWN, -step)
    pan = pan + rng.uniform(0, step)
    up, left = np.meshgrid(tilt, pan, indexing="ij")
    rays = np.stack([np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)], axis=-1)
    directions = sandbox_from_scanner.rotate(rays)
    hit = caster.first_hits(sandbox_from_scanner.translation, directions)
    corners = scene.vertices[scene.faces[hit.face]].astype(float)
    facing = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    facing /= np.maximum(np.linalg.norm(facing, axis=-1, keepdims=True), 1e-12)
    cosine = np.abs(np.einsum("...k,...k->...", facing, directions))
    albedo = scene.albedo_of_face[hit.face]
    distance = np.where(hit.distance < _MAX_RANGE_M, hit.distance, np.nan).astype(float)
    distance = _mixed(distance, rng, options.mixed_pixels)
    distance[rng.random(distance.shape) < _lost(cosine, albedo)] = np.nan
    distance += rng.normal(0, options.range_noise_mm / 1000, distance.shape)
    distance = np.round(distance / _STEP_M) * _STEP_M
    returned = albedo * cosine * (_WHITE_AT_M / np.nan_to_num(distance, nan=np.inf)) ** 2
    intensity = np.clip(np.round(_WHITE * returned + rng.normal(0, _INTENSITY_SD, returned.shape)), 0, 255)
    return Scan(sandbox_from_scanner.translation + distance[..., None] * directions, intensity)


def _mixed(distance: np.ndarray, rng: np.random.Generator, share: float) -> np.ndarray:
    """Replace a share of the ranges at depth edges by random values between both surfaces (mixed pixels)."""
    out = distance.copy()
    for axis in (0, 1):
        neighbour = np.roll(distance, -1, axis)
        edge = np.abs(neighbour - distance) > _EDGE
        edge[(-1,) if axis == 0 else (slice(None), -1)] = False
        mixed = edge & (rng.random(edge.shape) < share * 0.5)
        weight = rng.random(edge.shape)
        out[mixed] = (weight * distance + (1 - weight) * neighbour)[mixed]
    return out


def _lost(cosine: np.ndarray, albedo: np.ndarray) -> np.ndarray:
    """Return the probability of no return: high at grazing incidence and on dark surfaces."""
    grazing = np.clip((0.14 - cosine) / 0.14, 0, 1)
    dark = np.clip((0.20 - albedo) / 0.20, 0, 1)
    return np.clip(0.002 + 0.9 * grazing**1.5 + 0.25 * dark**2 + 0.6 * dark * grazing, 0, 1)


def join_points(scanned: Scan, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join neighbouring points without depth edge to triangles: vertices (v, 3), faces (f, 3)."""
    vertices = scanned.points.reshape(-1, 3)
    distance = np.linalg.norm(scanned.points - centre, axis=-1).ravel()
    faces = grid_faces(*scanned.points.shape[:2])
    near = distance[faces]
    with np.errstate(invalid="ignore"):
        jump = near.max(axis=1) - near.min(axis=1)
        joined = jump < np.maximum(_GAP, _GAP_SHARE * near.min(axis=1))
    return np.nan_to_num(vertices), faces[joined]


def range_map(surfaces: Sequence[tuple[np.ndarray, np.ndarray]], grid: Lens) -> np.ndarray:
    """Return the surface point (h, w, 3) float32 at each pixel, rectified left frame; NaN without surface."""
    whole = join_meshes([Mesh(*surface) for surface in surfaces])
    directions = grid.pixel_directions().astype(np.float32)
    hit = RayCaster(whole.vertices, whole.faces).first_hits(np.zeros(3), directions)
    depth = np.where(hit.is_hit, hit.distance, np.float32(np.nan))
    return np.round(depth[..., None] * directions / np.float32(_STEP_M)) * np.float32(_STEP_M)


def registration_error(rng: np.random.Generator) -> Pose:
    """Return a random rigid error of the registration of a scan with a camera."""
    rotation = np.radians(rng.normal(0, _REGISTRATION_DEG / np.sqrt(3), 3))
    return Pose.from_rotvec(rotation, rng.normal(0, _REGISTRATION_MM / 1000 / np.sqrt(3), 3))

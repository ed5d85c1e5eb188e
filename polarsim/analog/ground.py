"""Sand as a height field: fractal relief, trowel marks, pits, mounds, wheel tracks and a crater."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.special import expit

from polarsim.analog.presets import Preset
from polarsim.analog.rays import grid_faces

CRATER_CENTRE = np.array([-0.15, 0.25])
_CRATER_RADIUS = 1.0  # radius of the crest of the rim, metres


@dataclass(frozen=True)
class HeightField:
    """Height field (n, n), metres, sandbox frame; row i is at x = axis[i], column j at y = axis[j]."""

    axis: np.ndarray
    heights: np.ndarray

    @property
    def step(self) -> float:
        return float(self.axis[1] - self.axis[0])

    def height_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return bilinear heights at points; points outside the grid get the height at the border."""
        at = np.stack([np.asarray(x) - self.axis[0], np.asarray(y) - self.axis[0]]) / self.step
        return map_coordinates(self.heights, at, order=1, mode="nearest")

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (n * n, 3) and upward faces (f, 3)."""
        x, y = np.meshgrid(self.axis, self.axis, indexing="ij")
        vertices = np.stack([x, y, self.heights], axis=-1).reshape(-1, 3)
        return vertices, grid_faces(*self.heights.shape)

    def normals(self) -> np.ndarray:
        """Return unit normals (n * n, 3) of the vertices."""
        dx, dy = np.gradient(self.heights, self.step)
        normals = np.stack([-dx, -dy, np.ones_like(dx)], axis=-1).reshape(-1, 3)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def coarser(self, step: float) -> HeightField:
        """Return the ground sampled on a grid with approximately the given step."""
        count = max(2, round((self.axis[-1] - self.axis[0]) / step) + 1)
        axis = np.linspace(self.axis[0], self.axis[-1], count)
        x, y = np.meshgrid(axis, axis, indexing="ij")
        return HeightField(axis, self.height_at(x, y))


def make_ground(preset: Preset, step: float, rng: np.random.Generator) -> HeightField:
    """Generate the sand of a preset on a grid of about `step` metres; the height at the centre is about 0."""
    half = preset.half_width + 0.03
    count = round(2 * half / step) + 1
    axis = np.linspace(-half, half, count)
    step = float(axis[1] - axis[0])
    heights = preset.relief * 0.004 * _fractal_field(rng, count, step, 0.04, 1.2)
    heights += preset.relief * 0.012 * _fractal_field(rng, count, step, 0.7, 4.0)
    heights += _bumps(axis, rng, preset.mounds, 0.02, 0.05, 0.12, 0.35)
    heights -= _bumps(axis, rng, preset.pits, 0.012, 0.04, 0.03, 0.10)
    if preset.crater:
        heights += _crater(axis, rng, fresh=preset.crater == "fresh")
    for _ in range(round(420 * preset.trowel * (half / 2) ** 2)):
        _trowel(heights, axis, rng, preset.trowel)
    for _ in range(preset.tracks):
        _track(heights, axis, rng)
    grains = gaussian_filter(rng.standard_normal((count, count)), 0.8)
    heights += 0.00012 * grains / grains.std()
    if not preset.crater:
        window, _, _ = _window(axis, np.zeros(2), 0.1)
        heights -= heights[window].mean()
    return HeightField(axis, heights)


def _fractal_field(rng: np.random.Generator, size: int, step: float, shortest: float, longest: float) -> np.ndarray:
    """Return a periodic field (size, size) of unit variance with power proportional to frequency^-3.4; metres."""
    frequency = np.fft.fftfreq(size, step)
    radius = np.hypot(frequency[:, None], frequency[None, :])
    band = (radius > 1 / longest) & (radius < 1 / shortest)
    amplitude = np.where(band, np.maximum(radius, 1e-9) ** -1.7, 0.0)
    phases = np.fft.fft2(rng.standard_normal((size, size)))
    field = np.real(np.fft.ifft2(phases * amplitude))
    return field / field.std()


def pile_sand(ground: HeightField, rng: np.random.Generator, points: np.ndarray, radii: np.ndarray) -> HeightField:
    """Add low, uneven piles of sand around rocks at points (n, 2) with radii (n,)."""
    heights = ground.heights.copy()
    for position, radius in zip(points, radii, strict=True):
        window, dx, dy = _window(ground.axis, position, radius + 0.10)
        distance = np.hypot(dx, dy) - radius
        angle = np.arctan2(dy, dx)
        uneven = 0.6 + 0.4 * np.cos(angle - rng.uniform(0, 6.28)) + 0.3 * np.cos(3 * angle - rng.uniform(0, 6.28))
        heights[window] += rng.uniform(0.002, 0.010) * uneven * np.exp(-((distance / 0.03) ** 2))
    return HeightField(ground.axis, heights)


def _window(axis: np.ndarray, position: np.ndarray, reach: float) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
    """Return a grid window around a point, and the offsets (h, w) of the nodes from the point."""
    ranges = [slice(*np.searchsorted(axis, [centre - reach, centre + reach])) for centre in position]
    dx, dy = np.meshgrid(axis[ranges[0]] - position[0], axis[ranges[1]] - position[1], indexing="ij")
    return (ranges[0], ranges[1]), dx, dy


def _bumps(
    axis: np.ndarray, rng: np.random.Generator, count: int, low: float, high: float, narrow: float, wide: float
) -> np.ndarray:
    total = np.zeros((len(axis), len(axis)))
    for _ in range(count):
        width, angle, stretch = rng.uniform(narrow, wide), rng.uniform(0, np.pi), rng.uniform(0.5, 1)
        window, dx, dy = _window(axis, rng.uniform(-1.8, 1.8, 2), 3 * width)
        along = (dx * np.cos(angle) + dy * np.sin(angle)) * stretch
        across = dy * np.cos(angle) - dx * np.sin(angle)
        total[window] += rng.uniform(low, high) * np.exp(-(((along**2 + across**2) / width**2) ** 1.3))
    return total


def _trowel(heights: np.ndarray, axis: np.ndarray, rng: np.random.Generator, strength: float) -> None:
    """Add a trowel stroke: a shallow tilted bed with fine grooves, a ridge along the side and a lip at the end."""
    length, width = rng.uniform(0.08, 0.30), rng.uniform(0.02, 0.07)
    angle, bend = np.pi / 2 + rng.normal(0, 0.45), rng.normal(0, 0.8)
    window, dx, dy = _window(axis, rng.uniform(axis[0], axis[-1], 2), length + 0.1)
    along = (dx * np.cos(angle) + dy * np.sin(angle)) / length
    across = (dy * np.cos(angle) - dx * np.sin(angle) - bend * (along * length) ** 2) / width
    inside = expit((1 - np.abs(across)) / 0.08) * expit((1 - np.abs(along)) / 0.05)
    bed = rng.normal(0, 0.7) * across + rng.normal(0, 0.4) * along - 0.3 + 0.05 * np.cos(rng.uniform(8, 16) * across)
    ridge = np.exp(-(((across - 1.15) / 0.2) ** 2)) * expit((1 - np.abs(along)) / 0.1)
    lip = np.exp(-(((along - 1.05) * length / 0.012) ** 2)) * expit((1 - np.abs(across)) / 0.1)
    heights[window] += strength * rng.uniform(0.0015, 0.006) * (inside * bed + 0.35 * ridge * rng.random() + 0.5 * lip)


def _track(heights: np.ndarray, axis: np.ndarray, rng: np.random.Generator) -> None:
    """Add the two wheel tracks of a small rover with grouser prints."""
    angle, offset, bend = rng.uniform(0, np.pi), rng.uniform(-0.8, 0.8), rng.normal(0, 0.1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    along = x * np.cos(angle) + y * np.sin(angle)
    across = y * np.cos(angle) - x * np.sin(angle) - offset - bend * along**2
    for side in (-0.16, 0.16):
        rut = expit((0.035 - np.abs(across - side)) / 0.004)
        rim = np.exp(-(((np.abs(across - side) - 0.045) / 0.010) ** 2))
        heights += 0.004 * rim - rut * (0.008 + 0.003 * np.cos(2 * np.pi * along / 0.03))


def _crater(axis: np.ndarray, rng: np.random.Generator, *, fresh: bool) -> np.ndarray:
    """Return the heights of a crater with a raised, uneven rim; an old crater is shallower and smoother."""
    x, y = np.meshgrid(axis - CRATER_CENTRE[0], axis - CRATER_CENTRE[1], indexing="ij")
    angle = np.arctan2(y, x)
    wobble = sum(rng.normal(0, 0.025) * np.cos(k * angle + rng.uniform(0, 6.28)) for k in range(2, 9))
    radius = np.hypot(x, y) / (_CRATER_RADIUS * (1 + wobble))
    depth, rim, sharpness = (0.27, 0.10, 0.16) if fresh else (0.20, 0.06, 0.30)
    bowl = -depth * np.clip(1 - (radius / 0.95) ** 2.2, 0, None)
    uneven = 1 + 0.35 * np.cos(angle + rng.uniform(0, 6.28))
    inner = np.exp(-(((1 - radius) / sharpness) ** 2))
    outer = np.exp(-((np.clip(radius - 1, 0, None) / 0.22) ** 1.2))
    shape = bowl + rim * uneven * np.where(radius < 1, inner, outer)
    return gaussian_filter(shape, (0.008 if fresh else 0.05) / (axis[1] - axis[0]))

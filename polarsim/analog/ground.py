"""Sand as a height field: fractal relief, trowel marks, pits, mounds, wheel tracks and a crater."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.special import expit

from polarsim.analog.presets import Preset
from polarsim.analog.rays import grid_faces

PRESET_HALF_WIDTH = 2.0  # half the width of the sand for which presets and lengths below are chosen, metres
CRATER_CENTRE = np.array([-0.15, 0.25])
_CRATER_RADIUS = 1.0  # radius of the crest of the rim, metres
_OVERLAP = 0.03  # the sand extends below the walls, metres

Axes = tuple[np.ndarray, np.ndarray]  # nodes of a grid along x and y


@dataclass(frozen=True)
class HeightField:
    """Height field (n, m), metres, sandbox frame; row i is at x[i], column j at y[j]."""

    x: np.ndarray  # (n,) equidistant
    y: np.ndarray  # (m,) equidistant
    heights: np.ndarray

    @property
    def steps(self) -> tuple[float, float]:
        """Steps of the grid along x and y, metres."""
        return float(self.x[1] - self.x[0]), float(self.y[1] - self.y[0])

    def height_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return bilinear heights at points; points outside the grid get the height at the border."""
        dx, dy = self.steps
        at = np.stack([(np.asarray(x) - self.x[0]) / dx, (np.asarray(y) - self.y[0]) / dy])
        return map_coordinates(self.heights, at, order=1, mode="nearest")

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (n * m, 3) and upward faces (f, 3)."""
        x, y = np.meshgrid(self.x, self.y, indexing="ij")
        vertices = np.stack([x, y, self.heights], axis=-1).reshape(-1, 3)
        return vertices, grid_faces(*self.heights.shape)

    def normals(self) -> np.ndarray:
        """Return unit normals (n * m, 3) of the vertices."""
        dx, dy = np.gradient(self.heights, *self.steps)
        normals = np.stack([-dx, -dy, np.ones_like(dx)], axis=-1).reshape(-1, 3)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def coarser(self, step: float) -> HeightField:
        """Return the ground sampled on a grid with approximately the given step."""
        axes = _axis(self.x[0], self.x[-1], step), _axis(self.y[0], self.y[-1], step)
        x, y = np.meshgrid(*axes, indexing="ij")
        return HeightField(*axes, self.height_at(x, y))


def _axis(low: float, high: float, step: float) -> np.ndarray:
    """Return the nodes of a grid with approximately the given step."""
    return np.linspace(low, high, max(2, round((high - low) / step) + 1))


def make_ground(preset: Preset, half_width: tuple[float, float], step: float, rng: np.random.Generator) -> HeightField:
    """Generate the sand of a preset on a grid of about `step` metres; the height at the centre is about 0.

    `half_width`: half the size of the sand along x and y, metres.
    """
    reach_x, reach_y = (half + _OVERLAP for half in half_width)
    axes = _axis(-reach_x, reach_x, step), _axis(-reach_y, reach_y, step)
    shape = len(axes[0]), len(axes[1])
    steps = tuple(float(axis[1] - axis[0]) for axis in axes)
    heights = preset.relief * 0.004 * _fractal_field(rng, shape, steps, 0.04, 1.2)
    heights += preset.relief * 0.012 * _fractal_field(rng, shape, steps, 0.7, 4.0)
    share, edge = area_share(half_width), np.array(half_width) - 0.2
    heights += _bumps(axes, rng, edge, round(preset.mounds * share), 0.02, 0.05, 0.12, 0.35)
    heights -= _bumps(axes, rng, edge, round(preset.pits * share), 0.012, 0.04, 0.03, 0.10)
    if preset.crater:
        heights += _crater(axes, rng, crater_scale(half_width), fresh=preset.crater == "fresh")
    for _ in range(round(420 * preset.trowel * (axes[0][-1] / 2) * (axes[1][-1] / 2))):
        _trowel(heights, axes, rng, preset.trowel)
    for _ in range(preset.tracks):
        _track(heights, axes, rng, 0.4 * min(half_width))
    grains = gaussian_filter(rng.standard_normal(shape), 0.8)
    heights += 0.00012 * grains / grains.std()
    if not preset.crater:
        window, _, _ = _window(axes, np.zeros(2), 0.1)
        heights -= heights[window].mean()
    return HeightField(*axes, heights)


def area_share(half_width: tuple[float, float]) -> float:
    """Return the area of the sand relative to that of the presets."""
    return half_width[0] * half_width[1] / PRESET_HALF_WIDTH**2


def crater_scale(half_width: tuple[float, float]) -> float:
    """Return the size of a crater relative to that of the presets, so that it fits the sand."""
    return min(half_width) / PRESET_HALF_WIDTH


def _fractal_field(
    rng: np.random.Generator, shape: tuple[int, int], steps: Sequence[float], shortest: float, longest: float
) -> np.ndarray:
    """Return a periodic field of unit variance with power proportional to frequency^-3.4; metres."""
    along_x, along_y = (np.fft.fftfreq(size, step) for size, step in zip(shape, steps, strict=True))
    radius = np.hypot(along_x[:, None], along_y[None, :])
    band = (radius > 1 / longest) & (radius < 1 / shortest)
    amplitude = np.where(band, np.maximum(radius, 1e-9) ** -1.7, 0.0)
    phases = np.fft.fft2(rng.standard_normal(shape))
    field = np.real(np.fft.ifft2(phases * amplitude))
    return field / field.std()


def pile_sand(ground: HeightField, rng: np.random.Generator, points: np.ndarray, radii: np.ndarray) -> HeightField:
    """Add low, uneven piles of sand around rocks at points (n, 2) with radii (n,)."""
    heights = ground.heights.copy()
    for position, radius in zip(points, radii, strict=True):
        window, dx, dy = _window((ground.x, ground.y), position, radius + 0.10)
        distance = np.hypot(dx, dy) - radius
        angle = np.arctan2(dy, dx)
        uneven = 0.6 + 0.4 * np.cos(angle - rng.uniform(0, 6.28)) + 0.3 * np.cos(3 * angle - rng.uniform(0, 6.28))
        heights[window] += rng.uniform(0.002, 0.010) * uneven * np.exp(-((distance / 0.03) ** 2))
    return HeightField(ground.x, ground.y, heights)


def _window(axes: Axes, position: np.ndarray, reach: float) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
    """Return a grid window around a point, and the offsets (h, w) of the nodes from the point."""
    ranges = [
        slice(*np.searchsorted(axis, [centre - reach, centre + reach]))
        for axis, centre in zip(axes, position, strict=True)
    ]
    dx, dy = np.meshgrid(axes[0][ranges[0]] - position[0], axes[1][ranges[1]] - position[1], indexing="ij")
    return (ranges[0], ranges[1]), dx, dy


def _bumps(
    axes: Axes, rng: np.random.Generator, edge: np.ndarray, count: int, low: float, high: float, narrow: float,
    wide: float,
) -> np.ndarray:  # fmt: skip
    total = np.zeros((len(axes[0]), len(axes[1])))
    for _ in range(count):
        width, angle, stretch = rng.uniform(narrow, wide), rng.uniform(0, np.pi), rng.uniform(0.5, 1)
        window, dx, dy = _window(axes, rng.uniform(-edge, edge), 3 * width)
        along = (dx * np.cos(angle) + dy * np.sin(angle)) * stretch
        across = dy * np.cos(angle) - dx * np.sin(angle)
        total[window] += rng.uniform(low, high) * np.exp(-(((along**2 + across**2) / width**2) ** 1.3))
    return total


def _trowel(heights: np.ndarray, axes: Axes, rng: np.random.Generator, strength: float) -> None:
    """Add a trowel stroke: a shallow tilted bed with fine grooves, a ridge along the side and a lip at the end."""
    length, width = rng.uniform(0.08, 0.30), rng.uniform(0.02, 0.07)
    angle, bend = np.pi / 2 + rng.normal(0, 0.45), rng.normal(0, 0.8)
    window, dx, dy = _window(axes, rng.uniform(*((axes[0][k], axes[1][k]) for k in (0, -1))), length + 0.1)
    along = (dx * np.cos(angle) + dy * np.sin(angle)) / length
    across = (dy * np.cos(angle) - dx * np.sin(angle) - bend * (along * length) ** 2) / width
    inside = expit((1 - np.abs(across)) / 0.08) * expit((1 - np.abs(along)) / 0.05)
    bed = rng.normal(0, 0.7) * across + rng.normal(0, 0.4) * along - 0.3 + 0.05 * np.cos(rng.uniform(8, 16) * across)
    ridge = np.exp(-(((across - 1.15) / 0.2) ** 2)) * expit((1 - np.abs(along)) / 0.1)
    lip = np.exp(-(((along - 1.05) * length / 0.012) ** 2)) * expit((1 - np.abs(across)) / 0.1)
    heights[window] += strength * rng.uniform(0.0015, 0.006) * (inside * bed + 0.35 * ridge * rng.random() + 0.5 * lip)


def _track(heights: np.ndarray, axes: Axes, rng: np.random.Generator, reach: float) -> None:
    """Add the two wheel tracks of a small rover with grouser prints."""
    angle, offset, bend = rng.uniform(0, np.pi), rng.uniform(-reach, reach), rng.normal(0, 0.1)
    x, y = np.meshgrid(*axes, indexing="ij")
    along = x * np.cos(angle) + y * np.sin(angle)
    across = y * np.cos(angle) - x * np.sin(angle) - offset - bend * along**2
    for side in (-0.16, 0.16):
        rut = expit((0.035 - np.abs(across - side)) / 0.004)
        rim = np.exp(-(((np.abs(across - side) - 0.045) / 0.010) ** 2))
        heights += 0.004 * rim - rut * (0.008 + 0.003 * np.cos(2 * np.pi * along / 0.03))


def _crater(axes: Axes, rng: np.random.Generator, scale: float, *, fresh: bool) -> np.ndarray:
    """Return the heights of a crater with a raised, uneven rim; an old crater is shallower and smoother."""
    centre = scale * CRATER_CENTRE
    x, y = np.meshgrid(axes[0] - centre[0], axes[1] - centre[1], indexing="ij")
    angle = np.arctan2(y, x)
    wobble = sum(rng.normal(0, 0.025) * np.cos(k * angle + rng.uniform(0, 6.28)) for k in range(2, 9))
    radius = np.hypot(x, y) / (scale * _CRATER_RADIUS * (1 + wobble))
    depth, rim, sharpness = (0.27, 0.10, 0.16) if fresh else (0.20, 0.06, 0.30)
    bowl = -depth * np.clip(1 - (radius / 0.95) ** 2.2, 0, None)
    uneven = 1 + 0.35 * np.cos(angle + rng.uniform(0, 6.28))
    inner = np.exp(-(((1 - radius) / sharpness) ** 2))
    outer = np.exp(-((np.clip(radius - 1, 0, None) / 0.22) ** 1.2))
    shape = bowl + rim * uneven * np.where(radius < 1, inner, outer)
    return gaussian_filter(scale * shape, (0.008 if fresh else 0.05) / (axes[0][1] - axes[0][0]))

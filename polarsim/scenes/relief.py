"""Made-up relief of sand: ridges of a rake, swells and craters, for sand that nobody scanned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import fft

from polarsim.geometry.meshes import Mesh
from polarsim.scenes.options import SceneRanges

# Ranges, from least to most, that hold what rakes, feet and sieves leave in sand of a sandbox.
_FINEST_M, _WIDEST_M = 0.008, 0.4  # sizes of roughness: below, the mesh has no cells for it; above, it is a swell
_RIDGE_LENGTH_M, _RIDGE_WIDTH_M = (0.015, 0.12), (0.01, 0.03)  # correlation lengths along and across a ridge
_RIDGE_SD_M = (0.0003, 0.002)
_CRATER_RADIUS_M = (0.1, 1.1)  # at the crest
_CRATER_DEPTH = (0.1, 0.3)  # over the radius: from worn craters to fresh ones
_ROUGH_POWER = 1.5  # of the wave number, by which rough sand's amplitudes fall: at 2 it is as steep at every size


def smooth_noise(
    shape: tuple[int, int], along: float, across: float, angle: float, random: np.random.Generator
) -> np.ndarray:
    """(h, w) normal noise of mean 0 and sd 1, correlated over `along` and `across` cells; `angle`: of the long axis."""
    noise = summed_noise(shape, [(1.0, gaussian_waves(shape, along, across, angle))], random)
    noise -= noise.mean()
    return np.asarray(noise / noise.std())


def summed_noise(
    shape: tuple[int, int], layers: Sequence[tuple[float, np.ndarray]], random: np.random.Generator
) -> np.ndarray:
    """(h, w) sum of independent normal noises of mean 0: each a standard deviation and the amplitudes of its waves.

    The waves are drawn and summed before the only transform; amplitudes (h, w // 2 + 1) as `waves` counts them.
    """
    v, u = waves(shape)
    size = v.shape[0], u.shape[1]
    total = np.zeros(size, np.complex64)
    for sd, amplitude in layers:
        amplitude = amplitude.astype(np.float32)
        amplitude[0, 0] = 0
        energy = 2 * (amplitude**2).sum() - (amplitude[:, [0, -1]] ** 2).sum()  # of all waves, of which half are told
        drawn = random.standard_normal((2, *size), np.float32)
        total += np.float32(sd / np.sqrt(2 * energy)) * amplitude * (drawn[0] + 1j * drawn[1])
    field = fft.irfft2(total, (size[0], 2 * (size[1] - 1)), norm="forward")[: shape[0], : shape[1]]
    return np.asarray(field, float)


def waves(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Cycles a cell of the waves along rows (n, 1) and columns (1, m) of noise that is cut to a shape (h, w)."""
    high, wide = (2 * fft.next_fast_len(-(-size // 2), real=True) for size in shape)
    return np.fft.fftfreq(high)[:, None], np.fft.rfftfreq(wide)[None]


def gaussian_waves(shape: tuple[int, int], along: float, across: float, angle: float) -> np.ndarray:
    """Amplitudes of noise that is correlated over `along` and `across` cells; `angle`: of the long axis."""
    v, u = waves(shape)
    cosine, sine = np.cos(angle), np.sin(angle)
    exponent = (along * (cosine * u + sine * v)) ** 2 + (across * (cosine * v - sine * u)) ** 2
    return np.asarray(np.exp(-2 * np.pi**2 * exponent))


def rough_waves(shape: tuple[int, int], finest: float, widest: float) -> np.ndarray:
    """Amplitudes of rough noise with structure of every size from `finest` to `widest` cells."""
    v, u = waves(shape)
    wave = np.hypot(v, u)
    fine = np.exp(-2 * (np.pi * finest * wave) ** 2)
    return np.asarray(fine / np.maximum(wave, 1 / widest) ** _ROUGH_POWER)


def crater(x: np.ndarray, y: np.ndarray, radius: float, depth: float) -> np.ndarray:
    """Heights of a bowl about the origin, with a crest a fifth as high as the bowl is deep; flat beyond two radii."""
    distance = np.hypot(x, y) / radius
    crest = 0.2 * depth
    bowl = (depth + crest) * distance**2 - depth
    return np.where(distance < 1, bowl, crest * np.clip(2 - distance, 0, 1) ** 2)


def draw_relief(x: np.ndarray, y: np.ndarray, ranges: SceneRanges, random: np.random.Generator) -> np.ndarray:
    """(h, w) heights at nodes (h, w) of a square grid, rows along y; metres."""
    cell = float(x[0, 1] - x[0, 0])
    layers = []
    for _ in range(random.integers(ranges.most_layers + 1)):
        along, across, sd = (random.uniform(*limits) for limits in (_RIDGE_LENGTH_M, _RIDGE_WIDTH_M, _RIDGE_SD_M))
        angle = random.uniform(0, np.pi)
        layers.append((sd, gaussian_waves(x.shape, along / cell, across / cell, angle)))
    width = ranges.swell_width_m / cell
    layers.append((random.uniform(*ranges.swell_sd_m), gaussian_waves(x.shape, width, width, 0)))
    rough = random.uniform(*ranges.rough_sd_m)
    layers.append((rough, rough_waves(x.shape, _FINEST_M / cell, _WIDEST_M / cell)))
    height = summed_noise(x.shape, layers, random)
    for _ in range(random.integers(ranges.most_craters + 1)):
        radius, share = random.uniform(*_CRATER_RADIUS_M), random.uniform(*_CRATER_DEPTH)
        centre = random.uniform(0.8 * np.array([x.min(), y.min()]), 0.8 * np.array([x.max(), y.max()]))
        height += crater(x - centre[0], y - centre[1], radius, share * radius)
    return height


def grid_mesh(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Mesh:
    """Two triangles a cell of heights (h, w) at nodes (h, w), facing up where x grows along rows, y along columns."""
    numbers = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), faces)

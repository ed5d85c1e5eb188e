"""Generated height fields of ground.

- Spectral noise on a regular grid (`sum_noise` of `gaussian_waves` and `rough_waves`): sand of scenes.
- Octaves at arbitrary nodes (`octave_relief`): the rover's ground, fine near the drive and coarse at the horizon.
- Single craters (`crater`); fields of worn craters are in `rover.world.craters`.

Heights by octaves are self-affine: the root mean square difference of points at a distance L is `deviation_m`
(L / 1 m)^H (structure function of fractional Brownian relief; H is the Hurst exponent). For the Moon at 17 m and more,
the median of H is 0.95 in highlands and 0.76 in maria (Rosenburg et al., J. Geophys. Res. 116 (2011) E02001).

Each octave is a cubic B-spline through normal numbers on a square lattice of spacing s, with an amplitude in proportion
to s^H. Therefore heights can be computed at arbitrary nodes, fine or coarse. Octaves that are finer than the nodes fade
out, along either axis; otherwise, fine columns with coarse rows would show them as ridges, and as streaks at the
horizon. Near the finest and coarsest octave the power is lower: for octaves from 4 cm to 41 m it is 0.84 between 0.5
and 4 m with H = 0.9, and 0.74 with 0.76.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import fft
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from polarsim.geometry.meshes import Mesh
from polarsim.randomness import generator

_CUBIC = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
_SEPTIC = BSpline.basis_element(np.arange(-4.0, 5.0), extrapolate=False)  # correlation of two cubic splines
NEAR_ONLY_M = 2.0  # finer octaves are omitted outside the site, where they are smaller than a pixel
_ROUGH_POWER = 1.5  # exponent by which amplitudes of rough sand decrease with the wave number; 2 is equally steep


def smooth_noise(
    shape: tuple[int, int], along: float, across: float, angle: float, random: np.random.Generator
) -> np.ndarray:
    """Return normal noise (h, w) of mean 0 and sd 1, correlated over `along` and `across` cells at `angle`."""
    noise = sum_noise(shape, [(1.0, gaussian_waves(shape, along, across, angle))], random)
    noise -= noise.mean()
    return np.asarray(noise / noise.std())


def sum_noise(
    shape: tuple[int, int], layers: Sequence[tuple[float, np.ndarray]], random: np.random.Generator
) -> np.ndarray:
    """Return the sum (h, w) of independent normal noises of mean 0, given as standard deviation and wave amplitudes.

    The waves are sampled and summed before a single transform; amplitudes (h, w // 2 + 1) in the order of `waves`.
    """
    v, u = waves(shape)
    size = v.shape[0], u.shape[1]
    total = np.zeros(size, np.complex64)
    for sd, amplitude in layers:
        amplitude = amplitude.astype(np.float32)
        amplitude[0, 0] = 0
        energy = 2 * (amplitude**2).sum() - (amplitude[:, [0, -1]] ** 2).sum()  # of all waves; only half are stored
        drawn = random.standard_normal((2, *size), np.float32)
        total += np.float32(sd / np.sqrt(2 * energy)) * amplitude * (drawn[0] + 1j * drawn[1])
    field = fft.irfft2(total, (size[0], 2 * (size[1] - 1)), norm="forward")[: shape[0], : shape[1]]
    return np.asarray(field, float)


def waves(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return cycles per cell of the waves along rows (n, 1) and columns (1, m) of noise of a shape (h, w)."""
    high, wide = (2 * fft.next_fast_len(-(-size // 2), real=True) for size in shape)
    return np.fft.fftfreq(high)[:, None], np.fft.rfftfreq(wide)[None]


def gaussian_waves(shape: tuple[int, int], along: float, across: float, angle: float) -> np.ndarray:
    """Return amplitudes of noise that is correlated over `along` and `across` cells; `angle`: of the long axis."""
    v, u = waves(shape)
    cosine, sine = np.cos(angle), np.sin(angle)
    exponent = (along * (cosine * u + sine * v)) ** 2 + (across * (cosine * v - sine * u)) ** 2
    return np.asarray(np.exp(-2 * np.pi**2 * exponent))


def rough_waves(shape: tuple[int, int], finest: float, widest: float) -> np.ndarray:
    """Return amplitudes of rough noise with structure of every size from `finest` to `widest` cells."""
    v, u = waves(shape)
    wave = np.hypot(v, u)
    fine = np.exp(-2 * (np.pi * finest * wave) ** 2)
    return np.asarray(fine / np.maximum(wave, 1 / widest) ** _ROUGH_POWER)


def crater(x: np.ndarray, y: np.ndarray, radius: float, depth: float) -> np.ndarray:
    """Return heights of a bowl about the origin, with a crest of a fifth of its depth; flat outside two radii."""
    distance = np.hypot(x, y) / radius
    crest = 0.2 * depth
    bowl = (depth + crest) * distance**2 - depth
    return np.where(distance < 1, bowl, crest * np.clip(2 - distance, 0, 1) ** 2)


def spacings(finest_m: float, below_m: float) -> np.ndarray:
    """Return spacings (n,) of octaves from the finest, each twice the previous, all below `below_m`, m."""
    count = max(int(np.ceil(np.log2(below_m / finest_m))), 0)
    return np.asarray(finest_m * 2.0 ** np.arange(count))


def amplitudes(spacing: np.ndarray, hurst: float, deviation_m: float) -> np.ndarray:
    """Return standard deviations (n,) of each octave's lattice, m, so that points 1 m apart differ by `deviation_m`."""
    if not len(spacing):
        return spacing
    growth = spacing**hurst
    peak = float(_SEPTIC(0.0))
    squared = 2 * peak * (peak - np.nan_to_num(_SEPTIC(1.0 / spacing))) * growth**2
    return np.asarray(growth * deviation_m / np.sqrt(squared.sum()))


def octave_relief(
    x: np.ndarray,
    y: np.ndarray,
    *,
    spacing: np.ndarray,
    amplitude: np.ndarray,
    half_m: float,
    far_m: float,
    seed: int,
) -> np.ndarray:
    """Return heights (rows, columns) at nodes x (columns,) and y (rows,), m; fine octaves only within `half_m`.

    There are at least two nodes along each axis, in ascending order.
    """
    level = np.zeros((len(y), len(x)))
    for step, deviation in zip(spacing.tolist(), amplitude.tolist(), strict=True):
        reach = half_m if step < NEAR_ONLY_M else far_m
        count = 2 * int(np.ceil(reach / step)) + 3
        numbers = generator(seed, "relief", f"{step:.6g}").normal(0.0, deviation, (count, count))
        level += _weights(y, step, count) @ numbers @ _weights(x, step, count).T
    return level


def _visible_share(apart: np.ndarray, step: float) -> np.ndarray:
    """Return the share (n,) of an octave at nodes `apart` m apart: 1 up to half its spacing, 0 from its spacing."""
    t = np.clip(2 * apart / step - 1, 0.0, 1.0)
    return np.asarray(1 - t * t * (3 - 2 * t))


def _weights(at: np.ndarray, step: float, count: int) -> csr_array:
    """Return weights (n, count) of the lattice's numbers at nodes; zero outside the lattice, less at sparse nodes."""
    place = at / step + (count - 1) / 2
    number = np.floor(place).astype(int)[:, None] + np.arange(-1, 3)
    weight = np.nan_to_num(_CUBIC(place[:, None] - number)) * _visible_share(np.gradient(at), step)[:, None]
    inside = (number >= 0) & (number < count)
    rows = np.broadcast_to(np.arange(len(at))[:, None], number.shape)
    return csr_array((weight[inside], (rows[inside], number[inside])), shape=(len(at), count))


def grid_mesh(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Mesh:
    """Return two triangles per cell of heights (h, w) at nodes (h, w), facing up for x along rows, y along columns."""
    numbers = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), faces)

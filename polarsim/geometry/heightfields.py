"""Generated heights of ground.

- Spectral noise on a regular grid (`summed_noise` of `gaussian_waves` and `rough_waves`): sand of scenes.
- Octaves on any nodes (`octave_relief`): the rover's ground, fine near the drive and coarse at the horizon.
- One crater (`crater`); fields of worn craters are in `rover.world.craters`.

Heights by octaves are self-affine: of points L apart they differ by `deviation_m` (L / 1 m)^H in the root mean square
(structure function of fractional Brownian relief; H is the Hurst exponent). Of the Moon at 17 m and more H is 0.95 in
the median of highlands and 0.76 of maria (Rosenburg et al., J. Geophys. Res. 116 (2011) E02001).

It is a sum of octaves: on a square lattice of spacing s stand normal numbers, a cubic B-spline leads through them, and
its amplitude grows as s^H. So heights can be asked for on any nodes, fine ones here, coarse ones there. Octaves finer
than nodes can show fade out, along either axis: where fine columns cross coarse rows they would be ridges as long as
the rows are apart, and a fan of streaks and specks at the horizon. Where octaves end the power is lower: of octaves
from 4 cm to 41 m it is 0.84 between 0.5 and 4 m with H = 0.9, and 0.74 with 0.76.
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
_SEPTIC = BSpline.basis_element(np.arange(-4.0, 5.0), extrapolate=False)  # what two cubic ones have in common
NEAR_ONLY_M = 2.0  # octaves finer than this are left out beyond the site: there they are less than a pixel
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


def spacings(finest_m: float, below_m: float) -> np.ndarray:
    """(n,) spacings of octaves from the finest on, each twice the one before, all below another length, m."""
    count = max(int(np.ceil(np.log2(below_m / finest_m))), 0)
    return np.asarray(finest_m * 2.0 ** np.arange(count))


def amplitudes(spacing: np.ndarray, hurst: float, deviation_m: float) -> np.ndarray:
    """(n,) standard deviations of each octave's lattice, m, so that points 1 m apart differ by `deviation_m`."""
    if not len(spacing):
        return spacing
    own = spacing**hurst
    peak = float(_SEPTIC(0.0))
    squared = 2 * peak * (peak - np.nan_to_num(_SEPTIC(1.0 / spacing))) * own**2
    return np.asarray(own * deviation_m / np.sqrt(squared.sum()))


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
    """Heights (rows, columns) at nodes x (columns,) and y (rows,), m; fine octaves within `half_m`, all in `far_m`.

    There are two nodes or more along each axis, in rising order.
    """
    level = np.zeros((len(y), len(x)))
    for step, deviation in zip(spacing.tolist(), amplitude.tolist(), strict=True):
        reach = half_m if step < NEAR_ONLY_M else far_m
        count = 2 * int(np.ceil(reach / step)) + 3
        numbers = generator(seed, "relief", f"{step:.6g}").normal(0.0, deviation, (count, count))
        level += _weights(y, step, count) @ numbers @ _weights(x, step, count).T
    return level


def _shown(apart: np.ndarray, step: float) -> np.ndarray:
    """(n,) share of an octave that nodes so far apart show: all up to half its spacing, nothing from its spacing on."""
    t = np.clip(2 * apart / step - 1, 0.0, 1.0)
    return np.asarray(1 - t * t * (3 - 2 * t))


def _weights(at: np.ndarray, step: float, count: int) -> csr_array:
    """(n, count): of the lattice's numbers at each node; beyond the lattice there is nothing, on sparse nodes less."""
    place = at / step + (count - 1) / 2
    number = np.floor(place).astype(int)[:, None] + np.arange(-1, 3)
    weight = np.nan_to_num(_CUBIC(place[:, None] - number)) * _shown(np.gradient(at), step)[:, None]
    inside = (number >= 0) & (number < count)
    rows = np.broadcast_to(np.arange(len(at))[:, None], number.shape)
    return csr_array((weight[inside], (rows[inside], number[inside])), shape=(len(at), count))


def grid_mesh(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Mesh:
    """Two triangles a cell of heights (h, w) at nodes (h, w), facing up where x grows along rows, y along columns."""
    numbers = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), faces)

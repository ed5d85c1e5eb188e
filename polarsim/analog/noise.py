"""Random fields, fractal relief on a grid and lattice noise in space; evenly spread directions."""

from __future__ import annotations

import numpy as np


def fractal_field(rng: np.random.Generator, size: int, step: float, shortest: float, longest: float) -> np.ndarray:
    """(size, size) field of unit variance with power falling as wavelength^-3.4, periodic; metres as units."""
    frequency = np.fft.fftfreq(size, step)
    radius = np.hypot(frequency[:, None], frequency[None, :])
    band = (radius > 1 / longest) & (radius < 1 / shortest)
    amplitude = np.where(band, np.maximum(radius, 1e-9) ** -1.7, 0.0)
    phases = np.fft.fft2(rng.standard_normal((size, size)))
    field = np.real(np.fft.ifft2(phases * amplitude))
    return field / field.std()


def fibonacci_sphere(count: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the sphere, from +z to -z."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    longitude, level = np.pi * (1 + 5**0.5) * k, np.sqrt(1 - z * z)
    return np.stack([level * np.cos(longitude), level * np.sin(longitude), z], axis=1)


def lattice_noise(points: np.ndarray, table: np.ndarray) -> np.ndarray:
    """(n,) smooth noise at points (n, 3) in lattice steps, interpolated from a periodic (m, m, m) table."""
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


def octaves(rng: np.random.Generator, points: np.ndarray, cells: tuple[float, ...], falloff: float) -> np.ndarray:
    """(n,) sum of lattice noises at points (n, 3) with `cells` lattice steps a unit; amplitudes cells^-falloff."""
    total = np.zeros(len(points))
    for count in cells:
        table = rng.standard_normal((32, 32, 32))
        total += count**-falloff * lattice_noise(points * count + rng.uniform(0, 32, 3), table)
    return total

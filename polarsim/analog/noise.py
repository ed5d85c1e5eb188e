"""Random fields: fractal relief on a grid and lattice noise in space; evenly distributed directions."""

from __future__ import annotations

import numpy as np


def fractal_field(rng: np.random.Generator, size: int, step: float, shortest: float, longest: float) -> np.ndarray:
    """Return a periodic field (size, size) of unit variance with power proportional to frequency^-3.4; metres."""
    frequency = np.fft.fftfreq(size, step)
    radius = np.hypot(frequency[:, None], frequency[None, :])
    band = (radius > 1 / longest) & (radius < 1 / shortest)
    amplitude = np.where(band, np.maximum(radius, 1e-9) ** -1.7, 0.0)
    phases = np.fft.fft2(rng.standard_normal((size, size)))
    field = np.real(np.fft.ifft2(phases * amplitude))
    return field / field.std()


def fibonacci_sphere(count: int) -> np.ndarray:
    """Return unit vectors (count, 3) distributed evenly over the sphere, from +z to -z."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    longitude, level = np.pi * (1 + 5**0.5) * k, np.sqrt(1 - z * z)
    return np.stack([level * np.cos(longitude), level * np.sin(longitude), z], axis=1)


def lattice_noise(points: np.ndarray, table: np.ndarray) -> np.ndarray:
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


def octaves(rng: np.random.Generator, points: np.ndarray, cells: tuple[float, ...], falloff: float) -> np.ndarray:
    """Return the sum (n,) of lattice noises at points (n, 3) with `cells` steps per unit; amplitudes cells^-falloff."""
    total = np.zeros(len(points))
    for count in cells:
        table = rng.standard_normal((32, 32, 32))
        total += count**-falloff * lattice_noise(points * count + rng.uniform(0, 32, 3), table)
    return total

"""Random relief of sand: rake ridges, swells and craters."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.heightfields import crater, gaussian_waves, rough_waves, sum_noise
from polarsim.scenes.options import SceneRanges

# Ranges (minimum, maximum) that cover the traces of rakes, feet and sieves in a sandbox.
_FINEST_M, _WIDEST_M = 0.008, 0.4  # sizes of roughness: limited by the mesh below and by swells above
_RIDGE_LENGTH_M, _RIDGE_WIDTH_M = (0.015, 0.12), (0.01, 0.03)  # correlation lengths along and across a ridge
_RIDGE_SD_M = (0.0003, 0.002)
_CRATER_RADIUS_M = (0.1, 1.1)  # at the crest
_CRATER_DEPTH = (0.1, 0.3)  # over the radius: from worn craters to fresh ones


def draw_relief(x: np.ndarray, y: np.ndarray, ranges: SceneRanges, random: np.random.Generator) -> np.ndarray:
    """Return random heights (h, w) at the nodes (h, w) of a square grid with rows along y, metres."""
    cell = float(x[0, 1] - x[0, 0])
    layers = []
    for _ in range(random.integers(ranges.max_layers + 1)):
        along, across, sd = (random.uniform(*limits) for limits in (_RIDGE_LENGTH_M, _RIDGE_WIDTH_M, _RIDGE_SD_M))
        angle = random.uniform(0, np.pi)
        layers.append((sd, gaussian_waves(x.shape, along / cell, across / cell, angle)))
    width = ranges.swell_width_m / cell
    layers.append((random.uniform(*ranges.swell_sd_m), gaussian_waves(x.shape, width, width, 0)))
    rough = random.uniform(*ranges.rough_sd_m)
    layers.append((rough, rough_waves(x.shape, _FINEST_M / cell, _WIDEST_M / cell)))
    height = sum_noise(x.shape, layers, random)
    for _ in range(random.integers(ranges.max_craters + 1)):
        radius, share = random.uniform(*_CRATER_RADIUS_M), random.uniform(*_CRATER_DEPTH)
        centre = random.uniform(0.8 * np.array([x.min(), y.min()]), 0.8 * np.array([x.max(), y.max()]))
        height += crater(x - centre[0], y - centre[1], radius, share * radius)
    return height

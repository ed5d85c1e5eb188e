"""Where in and about a pixel its rays go: the same places in every pixel, each of the same weight."""

from __future__ import annotations

from math import isqrt

import numpy as np
from scipy.special import ndtri

from polarsim.render.sensor_options import SensorOptions

Offset = tuple[float, float]


def sample_offsets(options: SensorOptions) -> tuple[Offset, ...]:
    """(x, y) of a pixel's samples, in pixels from its centre; their mean is the pixel's value.

    A box: cells of equal size, one sample each. From 9 samples on, and in a Gaussian, the grid is turned so that no two
    samples share a row or column (Cook, ACM TOG 5 (1986) 51, and Chiu et al., Graphics Gems IV): an upright edge then
    makes as many shades as there are samples. A Gaussian: samples lie at its quantiles, so that pixels stay apart from
    one another and no weights are needed; they are moved outwards until their variance is that of the Gaussian, since
    the middles of its quantiles leave out its tails.
    """
    side = isqrt(options.samples)
    if options.pixel_filter == "gaussian":
        places = ndtri((np.arange(options.samples) + 0.5) / options.samples)
        places *= options.filter_sd_px / np.sqrt((places**2).mean())
        return _turned(places, side)
    if side <= 2:
        cells = [(cell + 0.5) / side - 0.5 for cell in range(side)]
        return tuple((x, y) for y in cells for x in cells)
    return _turned((np.arange(options.samples) + 0.5) / options.samples - 0.5, side)


def _turned(places: np.ndarray, side: int) -> tuple[Offset, ...]:
    """One sample in each of side x side cells, row and column by row and column of `places` (side^2,).

    A quarter turn takes the pattern to itself: no direction is blurred more than another.
    """
    return tuple(
        (float(places[column * side + row]), float(places[row * side + side - 1 - column]))
        for row in range(side)
        for column in range(side)
    )

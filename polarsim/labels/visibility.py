"""What a person can tell from its surroundings in a photo: contrast in grey values, and in units of a pixel's noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import window
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.labels.photos import Brightness, noise_dn

SURROUND = 0.35  # of a box's sides: the width of the frame around it with which it is compared
INNER = 0.8  # of a box's sides: the ellipse in which the thing itself is


@dataclass(frozen=True)
class Contrast:
    """How far a thing stands out of its surround: in grey values, and in units of a pixel's noise."""

    dn: float
    noises: float


NONE = Contrast(0.0, 0.0)


def contrast(brightness: Brightness, box: np.ndarray, exposure_ms: float) -> Contrast:
    """How far what a box (4,) frames stands out of its surround: root mean square difference.

    A rock has a lit and a dark side, so that its mean may be that of the sand: every pixel is compared with the
    median of the surround, and what noise alone adds is taken off.
    """
    height, width = brightness.rate.shape
    part = window(box, np.maximum((box[2:] - box[:2]) * SURROUND, 3.0), width, height)
    y, x = (np.arange(side.start, side.stop) + HALF_PIXEL for side in part)
    if min(len(x), len(y)) < 2:
        return NONE
    values = brightness.at(exposure_ms, part)
    centre, half = (box[:2] + box[2:]) / 2, np.maximum((box[2:] - box[:2]) / 2, 0.5)
    inner = (((y - centre[1]) / half[1]) ** 2)[:, None] + ((x - centre[0]) / half[0]) ** 2 < INNER**2
    framed = ((y > box[1]) & (y < box[3]))[:, None] & ((x > box[0]) & (x < box[2]))
    if not inner.any() or framed.all():
        return NONE
    surround = float(np.median(values[~framed]))
    noise = float(noise_dn(surround))
    excess = float(((values[inner] - surround) ** 2).mean()) - noise**2
    dn = float(np.sqrt(max(excess, 0.0)))
    return Contrast(dn, dn / noise)

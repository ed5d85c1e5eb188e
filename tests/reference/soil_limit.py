"""Driven wheel at steady slip, in the limit of small steps and cells of the soil contact model, by integrals.

Reference value for `contact`, and a fast forward model for fitting soils. The shear displacement is the slip velocity
integrated over the time since first contact of a fixed node, or of a point of the rim (Wong and Reece,
J. Terramechanics 4 (1967) 81) if this is smaller: a slipping wheel passes a node for longer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from polarsim.errors import RoverError
from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.shapes import Wheel

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)


@dataclass(frozen=True)
class Steady:
    """State of a wheel under a load at a given slip."""

    sinkage: float  # m
    pull: float  # N, drawbar pull
    torque: float  # N m


def steady_wheel(wheel: Wheel, law: ContactLaw, load: float, slip: float, peak: float = 0.0) -> Steady:
    """Return the sinkage at which the soil carries `load` newtons, pull and torque; K_e is infinite.

    `slip` is 1 minus the ratio of forward and rim speed, below 1. `peak` is the angle of maximum pressure as a share of
    the entry angle: 0, the lowest point, for soil of nodes; above 0 in front of it (Wong and Reece 1967).
    """

    def excess(sinkage: float) -> float:
        return _bear(wheel, law, sinkage, slip, peak)[0] - load

    deepest = wheel.radius * 0.999
    if excess(deepest) < 0:
        raise RoverError(f"the soil does not carry {load:g} N at slip {slip:g}: the wheel sinks to the axle")
    sinkage = brentq(excess, 1e-7, deepest, xtol=1e-9)
    _, pull, torque = _bear(wheel, law, sinkage, slip, peak)
    return Steady(sinkage, pull, torque)


def _bear(wheel: Wheel, law: ContactLaw, sinkage: float, slip: float, peak: float) -> tuple[float, float, float]:
    """Return vertical force, pull and torque; angles are zero at the lowest point, positive in front.

    A driven rim drags the soil by the component of slip along the ground. With the rim's speed w and the wheel's speed
    v = (1 - slip) w, this is (w - v cos) cos on the wheel's surface.
    """
    R = wheel.radius
    ahead = math.acos(1 - sinkage / R)
    exponent = law.n + law.n_slip * min(max(slip, 0.0), 1.0)
    stiffness = law.K_c / wheel.width + law.K_phi
    theta, weight = 0.5 * ahead * NODES + 0.5 * ahead, 0.5 * ahead * WEIGHTS
    # Behind the maximum, the pressure is that of a point as far between maximum and entry.
    pressed = np.where(theta < peak * ahead, ahead - theta * (1 - peak) / max(peak, 1e-12), theta)
    sigma = stiffness * (R * (np.cos(pressed) - math.cos(ahead))) ** exponent
    # Of the node, integrated over the time since first contact, R cos(theta) dtheta / v.
    two, three = (ahead_k - k for ahead_k, k in zip(_powers(np.array(ahead)), _powers(theta), strict=True))
    of_node = R * (two / (1 - slip) - three)
    of_rim = R * (ahead - theta - (1 - slip) * (math.sin(ahead) - np.sin(theta)))
    j = np.sign(of_node) * np.minimum(np.abs(of_node), np.abs(of_rim))
    tau = np.sign(j) * (law.c + sigma * law.tan_phi) * (1 - np.exp(-np.abs(j) / law.K))
    area = wheel.width * R * weight  # of the rim
    each = sigma * np.cos(theta) + tau * np.sin(theta), tau * np.cos(theta) - sigma * np.sin(theta), R * tau
    bears, pulls, torque = (float((part * area).sum()) for part in each)
    return bears, pulls, torque


def _powers(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return integrals of cos^2 and cos^3."""
    sine = np.sin(theta)
    return 0.5 * theta + 0.25 * np.sin(2 * theta), sine - sine**3 / 3

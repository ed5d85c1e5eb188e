"""Soil contact model, the reference: pressure after Bekker and Wong, shear after Janosi and Hanamoto, node by node.

After Krenn and Hirzinger (2008, 2011) and Chrono's `SCMTerrain` (Serban, Taves and Zhou, J. Comput. Nonlinear Dyn.
2023, doi 10.1115/1.4056851), with these differences: the force stands on the wheel's surface, not on the ground's,
unless asked for; shear displacement is a vector, so a standing wheel does not creep, and starts anew once its node has
been clear; only the elastic branches are damped, for damping of plastic flow would bear load that soil does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.nodes import FLOW, FREE, LEVEL, ORIGINAL, PLASTIC, ROCK, SHEAR_X, SHEAR_Z, START, YIELD, Ground
from polarsim.rover.soil.shapes import INVERSE_WIDTH, KIND, RADIUS, WHEEL, Bodies, half_extent, intersect

STEEPEST = 0.25  # vertical part of a surface's normal: a wheel's flank is at most four times as large as its cell
SLOWEST_RIM = 1e-3  # m/s, a wheel that turns more slowly has no slip to speak of
READINGS = ("sinkage", "depth", "power", "area")


@dataclass(frozen=True)
class Rule:
    """How the law is applied."""

    normal_of_terrain: bool = False  # as Chrono: forces on the ground's normal instead of the wheel's
    clearance: float = 0.003  # m above the soil at which a node forgets its shear
    shear_cap: float = 6.0  # of K: shear displacement that is remembered at most
    slip_length: float = 0.1  # m of the rim's travel in which the soil comes to know a slip; 0: at once


@dataclass(frozen=True)
class Wrenches:
    """On the bodies from the soil."""

    forces: np.ndarray  # (k, 3) N
    torques: np.ndarray  # (k, 3) N m about the centres
    readings: np.ndarray  # (k, 4): depth below the start level and below the original ground, m; power taken, W; area


def press(ground: Ground, bodies: Bodies, law: ContactLaw, rule: Rule, dt: float) -> Wrenches:
    """One step of the contact of all bodies, in their order; changes `ground`."""
    count = len(bodies.numbers)
    forces, torques, readings = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, len(READINGS)))
    slips = worked_slips(bodies, rule, dt)
    for body in range(count):
        exponent = law.n + law.n_slip * float(slips[body])
        forces[body], torques[body], readings[body] = _press_one(ground, bodies, body, law, exponent, rule, dt)
    return Wrenches(forces, torques, readings)


def worked_slips(bodies: Bodies, rule: Rule, dt: float) -> np.ndarray:
    """(k,) slips that count for sinkage, after a step more; changes `bodies.slips`.

    Slip digs by carrying soil away, which takes some travel: a wheel that has turned on the spot by a millimetre is at
    slip 1 but has dug nothing. So a slip comes to tell over about the length of the contact. Steady slip digs at once.
    """
    count = len(bodies.numbers)
    slips, length = (np.zeros(count), 0.0) if bodies.slips is None else (bodies.slips, rule.slip_length)
    for body in range(count):
        state = bodies.numbers[body], bodies.rotations[body], bodies.velocities[body], bodies.spins[body]
        rim, forward = _speeds(*state)
        kept = math.exp(-max(abs(rim), abs(forward)) * dt / length) if length > 0 else 0.0
        slips[body] = kept * slips[body] + (1 - kept) * slip_of(*state)
    return slips


def _speeds(numbers: np.ndarray, rotation: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> tuple[float, float]:
    """Of the rim, and of the wheel itself ahead over level ground, m/s."""
    axle = rotation[:, 1]
    level = float(np.hypot(axle[0], axle[1]))
    forward = float(velocity[0] * axle[1] - velocity[1] * axle[0]) / level if level > 0 else 0.0
    return float(spin @ axle) * float(numbers[RADIUS]), forward


def slip_of(numbers: np.ndarray, rotation: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> float:
    """How much a driven wheel's rim outruns it, 0 to 1; 0 for a wheel that is towed, braked or at rest."""
    rim, forward = _speeds(numbers, rotation, velocity, spin)
    if numbers[KIND] != WHEEL or abs(rim) < SLOWEST_RIM or rotation[:2, 1].tolist() == [0.0, 0.0]:
        return 0.0
    return min(max(1 - forward / rim, 0.0), 1.0)


def _press_one(
    ground: Ground, bodies: Bodies, body: int, law: ContactLaw, exponent: float, rule: Rule, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    numbers, centre, rotation = bodies.numbers[body], bodies.centres[body], bodies.rotations[body]
    rows, columns = ground.window(centre, half_extent(numbers, rotation))
    owner = ground.owner[rows, columns]
    y, x = np.meshgrid(ground.y[rows], ground.x[columns], indexing="ij")
    hits = intersect(numbers, centre, rotation, x.ravel(), y.ravel(), ground.cell)
    shape = owner.shape
    usable = owner != ROCK
    hit, surface = hits.hit.reshape(shape) & usable, hits.level.reshape(shape)
    state, slope = ground.state[rows, columns], ground.normals[rows, columns]
    s = slope[..., 2] * (state[..., START] - surface)
    tried = law.K_e * (s - state[..., PLASTIC])
    touched = hit & (tried > 0)
    left = ~touched & usable & (owner == body)
    state[left, LEVEL] = state[left, START] - state[left, PLASTIC] / slope[left, 2]
    clear = left & (~hit | (surface - state[..., LEVEL] > rule.clearance))
    state[clear, SHEAR_X : SHEAR_Z + 1] = 0
    owner[clear] = FREE
    other = touched & (owner != body)  # a second wheel does not find the shear of the first
    state[other, SHEAR_X : SHEAR_Z + 1] = 0
    owner[touched] = body

    arms = np.stack([x - centre[0], y - centre[1], surface - centre[2]], axis=-1)[touched]
    velocity = bodies.velocities[body] + np.cross(bodies.spins[body], arms)
    normal = (slope if rule.normal_of_terrain else hits.normal.reshape(*shape, 3))[touched]
    v_n = (velocity * normal).sum(axis=-1)
    nodes = state[touched]
    stiffness = law.K_c * numbers[INVERSE_WIDTH] + law.K_phi
    sigma = _pressure(nodes, s[touched], tried[touched], v_n, law, stiffness, exponent)
    slip = velocity - v_n[:, None] * normal
    tau, direction = _shear(nodes, sigma, normal, slope[touched], slip, law, rule, dt)
    nodes[:, LEVEL] = surface[touched]
    state[touched] = nodes

    # The cell is a square seen from above; the surface on which the stress stands is larger by its slope.
    area = ground.cell**2 / np.maximum(normal[:, 2], STEEPEST) * hits.weight.reshape(shape)[touched]
    loads = (sigma[:, None] * normal - tau[:, None] * direction) * area[:, None]
    readings = np.array(
        [
            (s[touched] / slope[touched, 2]).max(initial=0.0),
            (nodes[:, ORIGINAL] - surface[touched]).max(initial=0.0),
            -(loads * velocity).sum(),
            area.sum(),
        ]
    )
    return loads.sum(axis=0), np.cross(arms, loads).sum(axis=0), readings


def _pressure(
    nodes: np.ndarray,
    s: np.ndarray,
    tried: np.ndarray,
    v_n: np.ndarray,
    law: ContactLaw,
    stiffness: float,
    exponent: float,
) -> np.ndarray:
    """Elastic up to the pressure borne before, then Bekker's curve; the depth that stays is written to the nodes."""
    plastic = tried > nodes[:, YIELD]
    # Slip that rises lowers the curve, but soil that bore a pressure does not give way below it: else a wheel that
    # starts to turn, at slip 1 for a moment, would fall.
    curve = np.minimum(tried, np.maximum(stiffness * s**exponent, nodes[:, YIELD]))
    nodes[:, YIELD] = np.where(plastic, curve, nodes[:, YIELD])
    kept = np.where(plastic, s - curve / law.K_e, nodes[:, PLASTIC])
    nodes[:, FLOW] += np.maximum(kept - nodes[:, PLASTIC], 0.0)
    nodes[:, PLASTIC] = kept
    return np.where(plastic, curve, np.maximum(tried - law.R * v_n, 0.0))


def _shear(
    nodes: np.ndarray,
    sigma: np.ndarray,
    normal: np.ndarray,
    level: np.ndarray,
    slip: np.ndarray,
    law: ContactLaw,
    rule: Rule,
    dt: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Shear stress and, in the contact's surface, the direction in which the soil is dragged."""
    # A node remembers how far its soil was dragged along the ground as it lay before.
    j = nodes[:, SHEAR_X : SHEAR_Z + 1] + (slip - (slip * level).sum(axis=-1)[:, None] * level) * dt
    length = np.sqrt((j**2).sum(axis=-1))
    capped = np.minimum(length, rule.shear_cap * law.K)
    nodes[:, SHEAR_X : SHEAR_Z + 1] = j * (capped / np.where(length > 0, length, 1.0))[:, None]
    tau = (law.c + sigma * law.tan_phi) * (1 - np.exp(-capped / law.K))
    laid = j - (j * normal).sum(axis=-1)[:, None] * normal
    size = np.sqrt((laid**2).sum(axis=-1))
    direction = laid / np.where(size > 0, size, 1.0)[:, None]
    # Soil that is let go does not swing back: the same damping as in the elastic branch of pressure.
    rate = (slip * direction).sum(axis=-1)
    return np.where(rate < 0, np.maximum(tau + law.R * rate, 0.0), tau), direction

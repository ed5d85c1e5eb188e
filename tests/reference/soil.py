"""NumPy reference of the soil kernels for contact and displaced soil.

Names, arguments and results are those of `polarsim.rover.soil.contact` and `polarsim.rover.soil.bulldozing`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.rover.soil.bulldozing import DISTURBED, HEADROOM, MOVED, SQRT2, SWEEPS, Bulldozing
from polarsim.rover.soil.contact import CLEARANCE, SHEAR_CAP, SLIP_LENGTH, SLOWEST_RIM, STEEPEST, Loads
from polarsim.rover.soil.law import ContactLaw
from polarsim.rover.soil.nodes import (
    FLOW,
    FREE,
    LEVEL,
    ORIGINAL,
    PLASTIC,
    ROCK,
    SHEAR_X,
    SHEAR_Z,
    START,
    TOUCHED,
    YIELD,
    SoilGround,
)
from polarsim.rover.soil.shapes import HALF_WIDTH, INVERSE_WIDTH, LEVEL_AXLE, RADIUS, Bodies


@dataclass(frozen=True)
class Hits:
    """First intersections of vertical lines with a body from below; (n, ...) arrays, valid where `hit`."""

    hit: np.ndarray
    level: np.ndarray
    normal: np.ndarray  # (n, 3) into the body
    weight: np.ndarray  # share of a node's cell below the body


def _window(ground: SoilGround, numbers: np.ndarray, centre: np.ndarray, rotation: np.ndarray) -> tuple[slice, slice]:
    """Return rows and columns of the nodes that may be below a wheel."""
    axle = rotation[:2, 1]
    # Rounding makes an axle along y a little longer than 1.
    half = numbers[RADIUS] * np.sqrt(np.maximum(1 - axle**2, 0.0)) + numbers[HALF_WIDTH] * np.abs(axle)
    first = np.floor((centre[:2] - half - (ground.x0, ground.y0)) / ground.cell).astype(int)
    last = np.ceil((centre[:2] + half - (ground.x0, ground.y0)) / ground.cell).astype(int) + 1
    rows, columns = ground.owner.shape
    return (
        slice(max(first[1], 0), min(max(last[1], 0), rows)),
        slice(max(first[0], 0), min(max(last[0], 0), columns)),
    )


def _covered(distance: np.ndarray, half: float, cell: float) -> np.ndarray:
    """Return the share of a cell that a strip covers, for a cell at `distance` from the strip's centre line."""
    return np.clip((half - np.abs(distance)) / cell + 0.5, 0.0, 1.0)


def intersect(
    numbers: np.ndarray, centre: np.ndarray, rotation: np.ndarray, x: np.ndarray, y: np.ndarray, cell: float
) -> Hits:
    """Return the lowest points of a wheel above the nodes x, y (n,)."""
    radius, half = numbers[RADIUS], numbers[HALF_WIDTH]
    a = rotation[:, 1]
    dx, dy = x - centre[0], y - centre[1]
    e = dx * a[0] + dy * a[1]
    # Points on the cylinder at height h above the centre: A h^2 - 2 e a_z h + C = 0.
    A, C = 1 - a[2] ** 2, dx * dx + dy * dy - e * e - radius**2
    root = e * e * a[2] ** 2 - A * C
    crosses = root > 0
    h = (e * a[2] - np.sqrt(np.where(crosses, root, 0.0))) / A
    u = e + h * a[2]
    weight = np.where(crosses, _covered(u, half, cell), 0.0)
    normal = -np.stack([dx - u * a[0], dy - u * a[1], h - u * a[2]], axis=-1) / radius
    hit = weight > 0
    if abs(a[2]) > LEVEL_AXLE:  # a leaning wheel also has contact at the lower side
        side = -np.sign(a[2])
        cap_h = (side * half - e) / a[2]
        q = dx * dx + dy * dy + cap_h * cap_h - half * half
        cap = ~hit & crosses & (q < radius**2) & (side * u > half)
        h, weight = np.where(cap, cap_h, h), np.where(cap, 1.0, weight)
        normal[cap] = -side * a
        hit = hit | cap
    hit &= h < 0
    return Hits(hit, centre[2] + h, normal, np.where(hit, weight, 0.0))


def press(ground: SoilGround, bodies: Bodies, law: ContactLaw, dt: float) -> Loads:
    """Compute a step of the contact of all bodies, in order; changes `ground`."""
    loads, slips = Loads.zeros(len(bodies.shapes)), _slips(bodies, dt)
    for body in range(len(bodies.shapes)):
        exponent = law.n + law.n_slip * float(slips[body])
        loads.forces[body], loads.torques[body], loads.readings[body] = _press_one(
            ground, bodies, body, law, exponent, dt
        )
    return loads


def _slips(bodies: Bodies, dt: float) -> np.ndarray:
    """Return the (k,) slips for slip sinkage after a step; updates `bodies.slips`. None means present slips."""
    count = len(bodies.shapes)
    slips, length = (np.zeros(count), 0.0) if bodies.slips is None else (bodies.slips, SLIP_LENGTH)
    for body in range(count):
        axle, velocity = bodies.rotations[body][:, 1], bodies.velocities[body]
        level = float(np.hypot(axle[0], axle[1]))
        forward = float(velocity[0] * axle[1] - velocity[1] * axle[0]) / level if level > 0 else 0.0
        rim = float(bodies.spins[body] @ axle) * float(bodies.shapes[body][RADIUS])
        driven = abs(rim) >= SLOWEST_RIM and level > 0
        slip = min(max(1 - forward / rim, 0.0), 1.0) if driven else 0.0
        kept = math.exp(-max(abs(rim), abs(forward)) * dt / length) if length > 0 else 0.0
        slips[body] = kept * slips[body] + (1 - kept) * slip
    return slips


def _press_one(
    ground: SoilGround, bodies: Bodies, body: int, law: ContactLaw, exponent: float, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    numbers, centre, rotation = bodies.shapes[body], bodies.centres[body], bodies.rotations[body]
    rows, columns = _window(ground, numbers, centre, rotation)
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
    clear = left & (~hit | (surface - state[..., LEVEL] > CLEARANCE))
    state[clear, SHEAR_X : SHEAR_Z + 1] = 0
    owner[clear] = FREE
    other = touched & (owner != body)  # a second wheel does not inherit the shear of the first
    state[other, SHEAR_X : SHEAR_Z + 1] = 0
    state[other, TOUCHED] = state[other, PLASTIC]
    owner[touched] = body

    arms = np.stack([x - centre[0], y - centre[1], surface - centre[2]], axis=-1)[touched]
    velocity = bodies.velocities[body] + np.cross(bodies.spins[body], arms)
    normal = hits.normal.reshape(*shape, 3)[touched]
    v_n = (velocity * normal).sum(axis=-1)
    nodes = state[touched]
    stiffness = law.K_c * numbers[INVERSE_WIDTH] + law.K_phi
    sigma = _pressure(nodes, s[touched], tried[touched], v_n, law, stiffness, exponent)
    slip = velocity - v_n[:, None] * normal
    rim = float(bodies.spins[body] @ rotation[:, 1]) * float(numbers[RADIUS])
    largest = np.full(len(nodes), SHEAR_CAP * law.K)
    if abs(rim) >= SLOWEST_RIM:
        radius = numbers[RADIUS]
        depth = (s[touched] - nodes[:, TOUCHED]) / radius
        of_rim = _rim_shear(rotation[:, 1], normal, slope[touched], depth, bodies.velocities[body], slip, rim)
        largest = np.minimum(largest, radius * of_rim)
    tau, direction = _shear(nodes, sigma, normal, slope[touched], slip, law, dt, largest)
    nodes[:, LEVEL] = surface[touched]
    state[touched] = nodes

    # Seen from above the cell is a square; the loaded surface is larger because of the slope.
    area = ground.cell**2 / np.maximum(normal[:, 2], STEEPEST) * hits.weight.reshape(shape)[touched]
    loads = (sigma[:, None] * normal - tau[:, None] * direction) * area[:, None]
    deep = (s[touched] / slope[touched, 2]).max(initial=0.0), (nodes[:, ORIGINAL] - surface[touched]).max(initial=0.0)
    readings = np.array([*deep, -(loads * velocity).sum(), area.sum()])
    return loads.sum(axis=0), np.cross(arms, loads).sum(axis=0), readings


def _pressure(nodes, s, tried, v_n, law, stiffness, exponent):
    """Return the pressure: elastic up to the largest earlier pressure, then Bekker's curve; updates the nodes."""
    plastic = tried > nodes[:, YIELD]
    # Increasing slip lowers the curve, but soil keeps the pressure that it has carried. Otherwise a wheel that starts
    # to turn, with slip 1 for a moment, would drop.
    curve = np.minimum(tried, np.maximum(stiffness * s**exponent, nodes[:, YIELD]))
    nodes[:, YIELD] = np.where(plastic, curve, nodes[:, YIELD])
    kept = np.where(plastic, s - curve / law.K_e, nodes[:, PLASTIC])
    nodes[:, FLOW] += np.maximum(kept - nodes[:, PLASTIC], 0.0)
    nodes[:, PLASTIC] = kept
    return np.where(plastic, curve, np.maximum(tried - law.R * v_n, 0.0))


def _rim_shear(axle, normal, level, depth, velocity, slip, rim):
    """Return (n,) the shear displacement of points of the rim since they entered the soil, in wheel radii.

    `depth` (n,) in wheel radii, `slip` (n, 3) and `rim` in m/s. The time since the entry is the angle over the rotation
    rate.
    """
    forward = np.cross(axle, level)
    square = (forward**2).sum(axis=-1)
    entry_cosine = (normal * level).sum(axis=-1) - depth
    entry_sine = np.sqrt(np.maximum(square - entry_cosine**2, 0.0))
    ahead = entry_sine + np.sign(rim) * (normal * forward).sum(axis=-1)
    square = np.where(square > LEVEL_AXLE, square, np.nan)
    chord = (depth**2 + ahead**2) / square
    angle = np.sqrt(chord) * (1 + chord / 24 + chord**2 * 3 / 640 + chord**3 * 5 / 7168)  # 2 asin(sqrt(chord) / 2)
    along = angle - (forward @ velocity) / rim * ahead / square
    return np.nan_to_num(np.hypot(along, angle * (slip @ axle) / rim), nan=np.inf)


def _shear(nodes, sigma, normal, level, slip, law, dt, largest):
    """Return shear stress and the direction, in the contact surface, in which the soil is dragged."""
    # Shear displacement of a node, along the original ground.
    j = nodes[:, SHEAR_X : SHEAR_Z + 1] + (slip - (slip * level).sum(axis=-1)[:, None] * level) * dt
    length = np.sqrt((j**2).sum(axis=-1))
    capped = np.minimum(length, largest)
    nodes[:, SHEAR_X : SHEAR_Z + 1] = j * (capped / np.where(length > 0, length, 1.0))[:, None]
    tau = (law.c + sigma * law.tan_phi) * (1 - np.exp(-capped / law.K))
    tangential = j - (j * normal).sum(axis=-1)[:, None] * normal
    size = np.sqrt((tangential**2).sum(axis=-1))
    direction = tangential / np.where(size > 0, size, 1.0)[:, None]
    # Unloading is damped as in the elastic branch of pressure, so the soil does not oscillate.
    rate = (slip * direction).sum(axis=-1)
    return np.where(rate < 0, np.maximum(tau + law.R * rate, 0.0), tau), direction


def bulldoze(ground: SoilGround, bodies: Bodies, rule: Bulldozing) -> None:
    """Move aside the soil that the bodies pressed since the last call, then let it slide around them."""
    for body in range(len(bodies.shapes)):
        inner = _window(ground, bodies.shapes[body], bodies.centres[body], bodies.rotations[body])
        pressed = _sources(ground, inner)
        if pressed is None:
            continue
        outer = _wider(ground, pressed, len(rule.weights) // 2)
        _push(ground, bodies, body, outer, rule)
        for _ in range(SWEEPS):
            slide(ground, outer, rule.climb)


def settle(ground: SoilGround, angle_deg: float = 36.0, sweeps: int = 200, still_m: float = DISTURBED) -> None:
    """Let all disturbed ground slide until it rests."""
    everywhere = slice(0, ground.owner.shape[0]), slice(0, ground.owner.shape[1])
    for _ in range(sweeps):
        if slide(ground, everywhere, ground.cell * math.tan(math.radians(angle_deg)), corners=True) <= still_m:
            return


def slide(ground: SoilGround, part: tuple[slice, slice], climb: float, corners: bool = False) -> float:
    """Run a sweep over a part of the grid: adjacent nodes with a difference above `climb` exchange soil.

    With `corners`, diagonal nodes are also adjacent, at sqrt(2) times the distance. Returns the maximum change, m.
    """
    state, owner = ground.state[part], ground.owner[part]
    level = state[..., LEVEL]
    disturbed = np.abs(level - state[..., ORIGINAL]) > DISTURBED
    free = owner == FREE
    change = np.zeros_like(level)
    every, but_last, but_first = slice(None), slice(None, -1), slice(1, None)
    pairs = [
        ((every, but_last), (every, but_first), climb, MOVED),
        ((but_last, every), (but_first, every), climb, MOVED),
    ]
    if corners:
        pairs += [
            ((but_last, but_last), (but_first, but_first), SQRT2 * climb, MOVED / 2),
            ((but_last, but_first), (but_first, but_last), SQRT2 * climb, MOVED / 2),
        ]
    for first, second, rests, share in pairs:
        step = level[second] - level[first]
        may = free[first] & free[second] & (disturbed[first] | disturbed[second])
        moved = np.where(may, share * np.sign(step) * np.maximum(np.abs(step) - rests, 0.0), 0.0)
        change[first] += moved
        change[second] -= moved
    state[..., LEVEL] += change
    state[..., START] += change
    return float(np.abs(change).max())


def _push(ground: SoilGround, bodies: Bodies, body: int, part: tuple[slice, slice], rule: Bulldozing) -> None:
    state, owner, normals = ground.state[part], ground.owner[part], ground.normals[part]
    pressed = np.where(owner == ROCK, 0.0, state[..., FLOW] / normals[..., 2])
    y, x = np.meshgrid(ground.y[part[0]], ground.x[part[1]], indexing="ij")
    hits = intersect(
        bodies.shapes[body], bodies.centres[body], bodies.rotations[body], x.ravel(), y.ravel(), ground.cell
    )
    surface = hits.level.reshape(owner.shape)
    below = hits.hit.reshape(owner.shape) & (surface - state[..., LEVEL] < HEADROOM)
    room = ((owner == FREE) & ~below).astype(float)
    reached = _blur(room, rule.weights)
    sends = (pressed > 0) & (reached > 0)  # soil without room stays
    sent = np.where(sends, rule.share * pressed / np.where(sends, reached, 1.0), 0.0)
    gained = room * _blur(sent, rule.weights)
    state[..., LEVEL] += gained
    state[..., START] += gained
    state[sends, FLOW] = 0


def _blur(field: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Sum over adjacent nodes along columns, then along rows; values outside are zero."""
    reach = len(weights) // 2
    for axis in (1, 0):
        padded = np.pad(field, [(reach, reach) if axis == k else (0, 0) for k in (0, 1)])
        length = field.shape[axis]
        field = sum(
            weight * np.take(padded, np.arange(at, at + length), axis=axis) for at, weight in enumerate(weights)
        )
    return field


def _sources(ground: SoilGround, part: tuple[slice, slice]) -> tuple[slice, slice] | None:
    """Return the bounds of the pressed nodes of a window."""
    rows, columns = np.nonzero((ground.state[part][..., FLOW] > 0) & (ground.owner[part] != ROCK))
    if not len(rows):
        return None
    top, left = part[0].start, part[1].start
    return (
        slice(top + int(rows.min()), top + int(rows.max()) + 1),
        slice(left + int(columns.min()), left + int(columns.max()) + 1),
    )


def _wider(ground: SoilGround, part: tuple[slice, slice], by: int) -> tuple[slice, slice]:
    rows, columns = (
        slice(max(side.start - by, 0), min(side.stop + by, count))
        for side, count in zip(part, ground.owner.shape, strict=True)
    )
    return rows, columns

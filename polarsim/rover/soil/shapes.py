"""Bodies that press the ground: wheels with or without grousers, and plates, met by vertical lines.

A body's frame: x forward, y along the axle to the left, z up. A wheel rolls forward when it spins about +y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.errors import RoverError

# A shape's numbers in the order in which the kernels take them.
KIND, RADIUS, HALF_WIDTH, INVERSE_WIDTH, GROUSERS, GROUSER_HEIGHT, HALF_THICKNESS, HALF_LENGTH = range(8)
WHEEL, PLATE = 0.0, 1.0
LEVEL_AXLE = 1e-9  # an axle that leans less is level


@dataclass(frozen=True)
class Wheel:
    """A rigid cylinder, and straight grousers on it as boxes that point outwards; lengths in metres."""

    radius: float
    width: float
    grousers: int = 0
    grouser_height: float = 0.0
    grouser_thickness: float = 0.0

    @property
    def reach(self) -> float:
        """No point of the wheel is farther from its centre."""
        return math.hypot(self.radius + self.grouser_height * (self.grousers > 0), self.width / 2)

    def numbers(self, cell: float) -> np.ndarray:
        """For the kernels; refused where the grid is too coarse to see a grouser."""
        if min(self.radius, self.width) <= 0:
            raise RoverError(f"a wheel of radius {self.radius:g} m and width {self.width:g} m")
        if self.grousers and self.grouser_thickness < cell:
            raise RoverError(
                f"grousers {1000 * self.grouser_thickness:g} mm thick fall between nodes {1000 * cell:g} mm apart: "
                "take finer cells or a wheel without"
            )
        return np.array(
            [
                WHEEL,
                self.radius,
                self.width / 2,
                1 / self.width,
                self.grousers,
                self.grouser_height,
                self.grouser_thickness / 2,
                0.0,
            ]
        )


@dataclass(frozen=True)
class Plate:
    """A flat plate, such as a bevameter's; its centre lies in its lower face. Lengths in metres."""

    length: float
    width: float
    inverse_width: float | None = None  # 1/b of Bekker's law, 1/m; one over the width where nothing is said

    @property
    def reach(self) -> float:
        return math.hypot(self.length / 2, self.width / 2)

    def numbers(self, cell: float) -> np.ndarray:  # noqa: ARG002  the same call as a wheel's
        inverse = 1 / self.width if self.inverse_width is None else self.inverse_width
        return np.array([PLATE, 0.0, self.width / 2, inverse, 0.0, 0.0, 0.0, self.length / 2])


@dataclass(frozen=True)
class Bodies:
    """What presses the ground, in the world's frame; angular velocities include a wheel's spin."""

    numbers: np.ndarray  # (k, 8) of shapes
    centres: np.ndarray  # (k, 3)
    rotations: np.ndarray  # (k, 3, 3) world from body
    velocities: np.ndarray  # (k, 3)
    spins: np.ndarray  # (k, 3) rad/s
    slips: np.ndarray | None = None  # (k,) at which the soil under each was worked lately, changed; None: their own


def reach(numbers: np.ndarray) -> float:
    """Of several shapes' (k, 8) numbers: no body reaches farther from its centre, metres."""
    tip = numbers[:, RADIUS] + numbers[:, GROUSER_HEIGHT] * (numbers[:, GROUSERS] > 0)
    return float(np.hypot(np.maximum(tip, numbers[:, HALF_LENGTH]), numbers[:, HALF_WIDTH]).max())


def half_extent(numbers: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(2,) metres along x and y, from its centre, beyond which a body of `numbers` (8,) reaches nowhere."""
    length = np.maximum(numbers[RADIUS] + numbers[GROUSER_HEIGHT] * (numbers[GROUSERS] > 0), numbers[HALF_LENGTH])
    width = numbers[HALF_WIDTH]
    # A wheel is a disc of any rotation; a plate rotates with its frame and gets the circle around it.
    axle = rotation[:2, 1] if numbers[KIND] == WHEEL else np.zeros(2)
    # Rounding makes an axle along y a little longer than 1.
    half = length * np.sqrt(np.maximum(1 - axle**2, 0.0)) + width * np.abs(axle)
    return np.asarray(half if numbers[KIND] == WHEEL else half + width)


# The wheel of VIPER's mobility unit MGRU3, after Hu et al. (arXiv 2405.11001).
MGRU3 = Wheel(radius=0.25, width=0.20, grousers=24, grouser_height=0.025, grouser_thickness=0.010)


@dataclass(frozen=True)
class Hits:
    """Where vertical lines first meet a body from below; (n, ...) arrays, valid where `hit`."""

    hit: np.ndarray
    level: np.ndarray
    normal: np.ndarray  # (n, 3) into the body
    weight: np.ndarray  # share of a node's cell below the body


def intersect(
    numbers: np.ndarray, centre: np.ndarray, rotation: np.ndarray, x: np.ndarray, y: np.ndarray, cell: float
) -> Hits:
    """Lowest points of a body above the nodes (x, y).

    Parameters
    ----------
    numbers : (8,) float
        `Wheel.numbers` or `Plate.numbers`.
    centre, rotation : (3,), (3, 3) float
        The body's position; columns of the rotation are its axes in the world.
    x, y : (n,) float
        Nodes.
    """
    if numbers[KIND] == PLATE:
        return _intersect_plate(numbers, centre, rotation, x, y, cell)
    hits = _intersect_rim(numbers, centre, rotation, x, y, cell)
    for number in range(int(numbers[GROUSERS])):
        hits = _lower(hits, _intersect_grouser(number, numbers, centre, rotation, x, y, cell))
    return hits


def _covered(distance: np.ndarray, half: float, cell: float) -> np.ndarray:
    """Share of a cell at `distance` from the centre of a strip that the strip covers.

    So a load does not jump when a wheel's edge passes a row of nodes.
    """
    return np.clip((half - np.abs(distance)) / cell + 0.5, 0.0, 1.0)


def _intersect_plate(
    numbers: np.ndarray, centre: np.ndarray, rotation: np.ndarray, x: np.ndarray, y: np.ndarray, cell: float
) -> Hits:
    forward, left, up = rotation.T
    if up[2] < 0.5:
        raise RoverError("a plate that stands on edge")
    dx, dy = x - centre[0], y - centre[1]
    h = -(dx * up[0] + dy * up[1]) / up[2]
    along = dx * forward[0] + dy * forward[1] + h * forward[2]
    across = dx * left[0] + dy * left[1] + h * left[2]
    weight = _covered(along, numbers[HALF_LENGTH], cell) * _covered(across, numbers[HALF_WIDTH], cell)
    return Hits(weight > 0, centre[2] + h, np.broadcast_to(up, (len(x), 3)).copy(), weight)


def _intersect_rim(
    numbers: np.ndarray, centre: np.ndarray, rotation: np.ndarray, x: np.ndarray, y: np.ndarray, cell: float
) -> Hits:
    radius, half = numbers[RADIUS], numbers[HALF_WIDTH]
    a = rotation[:, 1]
    dx, dy = x - centre[0], y - centre[1]
    e = dx * a[0] + dy * a[1]
    # Of the points at height h above the centre, those on the cylinder: A h^2 - 2 e a_z h + C = 0.
    A, C = 1 - a[2] ** 2, dx * dx + dy * dy - e * e - radius**2
    root = e * e * a[2] ** 2 - A * C
    crosses = root > 0
    h = (e * a[2] - np.sqrt(np.where(crosses, root, 0.0))) / A
    u = e + h * a[2]
    weight = np.where(crosses, _covered(u, half, cell), 0.0)
    normal = -np.stack([dx - u * a[0], dy - u * a[1], h - u * a[2]], axis=-1) / radius
    hit = weight > 0
    if abs(a[2]) > LEVEL_AXLE:  # a leaning wheel also bears on its lower side
        side = -np.sign(a[2])
        cap_h = (side * half - e) / a[2]
        q = dx * dx + dy * dy + cap_h * cap_h - half * half
        cap = ~hit & crosses & (q < radius**2) & (side * u > half)
        h, weight = np.where(cap, cap_h, h), np.where(cap, 1.0, weight)
        normal[cap] = -side * a
        hit = hit | cap
    hit &= h < 0
    return Hits(hit, centre[2] + h, normal, np.where(hit, weight, 0.0))


def _intersect_grouser(
    number: int,
    numbers: np.ndarray,
    centre: np.ndarray,
    rotation: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    cell: float,
) -> Hits:
    """A box from the rim outwards. The soil meets it as a part of a larger rim: its normal is the radius."""
    angle = 2 * math.pi * number / numbers[GROUSERS]
    forward, a, up = rotation.T
    radial = math.cos(angle) * forward + math.sin(angle) * up
    tangent = math.cos(angle) * up - math.sin(angle) * forward
    dx, dy = x - centre[0], y - centre[1]
    tip, wide = numbers[RADIUS] + numbers[GROUSER_HEIGHT], numbers[HALF_WIDTH] + cell / 2
    spans = ((radial, 0.0, tip), (tangent, -numbers[HALF_THICKNESS], numbers[HALF_THICKNESS]), (a, -wide, wide))
    enters, leaves = [], []
    for axis, low, high in spans:
        at = dx * axis[0] + dy * axis[1]
        if abs(axis[2]) < LEVEL_AXLE:
            enters.append(np.full(len(x), -np.inf))
            leaves.append(np.where((at < low) | (at > high), -np.inf, np.inf))
        else:
            one, two = (low - at) / axis[2], (high - at) / axis[2]
            enters.append(np.minimum(one, two))
            leaves.append(np.maximum(one, two))
    # The box's sides lie half a cell off the wheel's: a line that enters there meets none of its width, and is no hit.
    enter = np.maximum(enters[0], enters[1])
    hit = (enters[2] < enter) & (enter < np.minimum.reduce(leaves)) & (enter < 0)
    h = np.where(hit, enter, 0.0)
    u = dx * a[0] + dy * a[1] + h * a[2]
    weight = np.where(hit, _covered(u, numbers[HALF_WIDTH], cell), 0.0)
    outward = np.stack([dx - u * a[0], dy - u * a[1], h - u * a[2]], axis=-1)
    length = np.sqrt((outward**2).sum(axis=-1, keepdims=True))
    normal = np.where(length > 0, -outward / np.where(length > 0, length, 1.0), 0.0)
    return Hits(hit & (weight > 0), centre[2] + h, normal, weight)


def _lower(one: Hits, other: Hits) -> Hits:
    """Of two bodies the one that a line from below meets first."""
    take = other.hit & (~one.hit | (other.level < one.level))
    return Hits(
        one.hit | other.hit,
        np.where(take, other.level, one.level),
        np.where(take[:, None], other.normal, one.normal),
        np.where(take, other.weight, one.weight),
    )

"""Visibility: what lamps light, what stands out in a photo, and what annotators draw at an exposure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import window
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.labels.bodies import World
from polarsim.labels.brightness import Brightness, noise_dn
from polarsim.labels.label import Label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.seeds import ShadowStarts, UnlitStarts, is_unlit
from polarsim.photo import SHADOW, Azimuth, PhotoKey

NO_SUN_START_MS = 2048  # shortest labelled exposure where only the rover light shines, as people labelled the release
POINTS = 150  # of a rock's surface, about, to which rays are cast
LIFT = 0.003  # metres from the surface towards the lamp: where a ray starts, clear of the rock's own faces
FARTHEST = np.diag([0.6, 0.6, 0.3])  # metres, x y z: twice the survey's standard deviations
OFFSETS = np.concatenate([np.zeros((1, 3)), FARTHEST, -FARTHEST])  # of a lamp about the surveyed one
SURROUND = 0.35  # of a box's sides: the width of the frame around it with which it is compared
INNER = 0.8  # of a box's sides: the ellipse in which the thing itself is


def lit_share(world: World, rock: int, azimuth: Azimuth) -> float:
    """Share of a rock's body above the ground that a Sun lamp reaches; 1 without body or lamp."""
    body = world.bodies.get(rock)
    if body is None or azimuth not in world.suns:
        return 1.0
    points = surface(world, rock)
    return float((~shaded(world, points, world.suns[azimuth])).mean()) if len(points) else 0.0


def surface(world: World, rock: int) -> np.ndarray:
    """(n, 3) of a body's surface above the ground, about `POINTS`."""
    body = world.bodies[rock]
    points = body.vertices[body.above]
    return points[:: max(1, len(points) // POINTS)]


def shaded(world: World, points: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """(n,) bool: ground, a rock or a wall stands between points (n, 3) and a lamp (3,)."""
    to_lamp = lamp - points
    starts = points + LIFT * to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    dark = world.everything.occluded(starts, to_lamp, 1.0)
    if world.walls is not None and not dark.all():
        dark |= world.walls.occluded(starts, to_lamp, 1.0)
    return np.asarray(dark)


def hidden_by_dark(world: World, rock: int, azimuth: Azimuth, annotated: Iterable[Azimuth]) -> bool:
    """A rock that people do not draw under a Sun lamp, for it is dark there.

    The survey localises lamps to decimetres only, and walls and slopes throw long shadows. A rock counts as dark if it
    is so wherever the lamp may have stood, and if it should not be dark as well at the azimuths where people drew it
    (`annotated`): there the meshes or the walls are not as they were.
    """
    return in_the_dark(world, rock, azimuth) and not any(in_the_dark(world, rock, other) for other in annotated)


def in_the_dark(world: World, rock: int, azimuth: Azimuth) -> bool:
    """No point of a rock's body above the ground is lit, wherever within the survey's error the lamp stands."""
    if rock not in world.bodies or azimuth not in world.suns:
        return False
    points = surface(world, rock)
    return all(shaded(world, points, world.suns[azimuth] + off).all() for off in OFFSETS)


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


@dataclass(frozen=True)
class Starts:
    """From which exposures on people see what, by what they drew: shadows under Sun lamps, rocks without a lamp."""

    shadows: ShadowStarts
    unlit: UnlitStarts


def visible(
    labels: list[Label], key: PhotoKey, brightness: Brightness | None, starts: Starts, options: LabelsOptions
) -> list[Label]:
    """The labels of an exposure bracket that one of its photos shows; without brightness, as people draw them."""
    if brightness is None:
        return at_exposure(labels, key, starts)
    return [label for label in labels if stands_out(label, brightness, key.exposure_ms, options)]


def stands_out(label: Label, brightness: Brightness, exposure_ms: int, options: LabelsOptions) -> bool:
    """Whether a person can tell a label from its surround at an exposure."""
    found = contrast(brightness, label.box, exposure_ms)
    return found.noises >= options.min_contrast and found.dn >= options.min_contrast_dn


def at_exposure(labels: list[Label], key: PhotoKey, starts: Starts) -> list[Label]:
    """The labels that a photo's exposure lets a person see.

    Under a Sun lamp rocks at once and shadows from their own start on, under the rover light alone all from
    `NO_SUN_START_MS` on. Without any lamp none, but from the exposure on at which people drew the position's own.
    """
    if is_unlit(key.light, key.azimuth):
        return labels if starts.unlit.shown(key) else []
    if key.azimuth == "no":
        return labels if key.exposure_ms >= NO_SUN_START_MS else []
    dark = key.exposure_ms < starts.shadows.of(key)
    return [label for label in labels if not (dark and label.kind == SHADOW)]

"""Visibility of labels: illumination by lamps, contrast in a photo, and minimum exposures of annotators."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import pixel_window
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.labels.bodies import TerrainCasters
from polarsim.labels.brightness import Brightness
from polarsim.labels.label import Label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.seeds import MinExposures, is_unlit
from polarsim.photo import SHADOW, Azimuth, PhotoKey
from polarsim.run_files.lamps import error_scale

POINTS = 150  # approximate number of rays cast to the surface of a rock
LIFT = 0.003  # metres from the surface to the start of a shadow ray, to avoid self-intersection
LAMP_ERROR = np.diag([0.6, 0.6, 0.3])  # metres, x y z: two standard deviations of the surveyed lamp positions
OFFSETS = np.concatenate([np.zeros((1, 3)), LAMP_ERROR, -LAMP_ERROR])  # of a lamp from the surveyed position
SURROUND = 0.35  # width of the frame around a box that contrast refers to, relative to the sides of the box
INNER = 0.8  # diameter of the ellipse that contains the object, relative to the sides of the box


def lit_rock_share(world: TerrainCasters, rock: int, azimuth: Azimuth) -> float:
    """Return the share of the surface of a rock lit by a Sun lamp; 1 without a body or lamp."""
    body = world.bodies.get(rock)
    if body is None or azimuth not in world.suns:
        return 1.0
    points = body_points(world, rock)
    return float((~shaded(world, points, world.suns[azimuth])).mean()) if len(points) else 0.0


def body_points(world: TerrainCasters, rock: int) -> np.ndarray:
    """Return about `POINTS` surface points (n, 3) of a rock above the ground."""
    body = world.bodies[rock]
    points = body.vertices[body.above]
    return points[:: max(1, len(points) // POINTS)]


def shaded(world: TerrainCasters, points: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """Return whether ground, a rock or a wall occludes a lamp (3,) from points (n, 3)."""
    to_lamp = lamp - points
    starts = points + LIFT * to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    dark = world.everything.occluded(starts, to_lamp, 1.0)
    if world.walls is not None and not dark.all():
        dark |= world.walls.occluded(starts, to_lamp, 1.0)
    return np.asarray(dark)


def omitted_in_dark(world: TerrainCasters, rock: int, azimuth: Azimuth, annotated: Iterable[Azimuth]) -> bool:
    """Return whether annotators omit a rock under a Sun lamp because it is dark.

    Lamp positions have errors of decimetres, and walls and slopes cast long shadows. A rock is dark if it is dark for
    all lamp positions within the error. If it is also computed as dark at an azimuth at which it is `annotated`, the
    meshes or walls are inaccurate and the result is False.
    """
    return is_dark(world, rock, azimuth) and not any(is_dark(world, rock, other) for other in annotated)


def is_dark(world: TerrainCasters, rock: int, azimuth: Azimuth) -> bool:
    """Return whether no surface point of a rock is lit for any lamp position within the error of the survey."""
    if rock not in world.bodies or azimuth not in world.suns:
        return False
    points = body_points(world, rock)
    lamp = world.suns[azimuth]
    return all(shaded(world, points, lamp + error_scale(lamp) * off).all() for off in OFFSETS)


@dataclass(frozen=True)
class Contrast:
    """Contrast of an object with its surroundings: in grey values, and in standard deviations of pixel noise."""

    dn: float
    snr: float


NO_CONTRAST = Contrast(0.0, 0.0)


def label_contrast(brightness: Brightness, box: np.ndarray, exposure_ms: float) -> Contrast:
    """Return the RMS difference of the pixels in a box (4,) from the median of the surroundings, without noise.

    The mean difference is unsuitable: a rock with a lit and a dark side can have the mean brightness of the sand.
    """
    height, width = brightness.rate.shape
    part = pixel_window(box, np.maximum((box[2:] - box[:2]) * SURROUND, 3.0), width, height)
    y, x = (np.arange(side.start, side.stop) + HALF_PIXEL for side in part)
    if min(len(x), len(y)) < 2:
        return NO_CONTRAST
    values = brightness.at(exposure_ms, part)
    centre, half = (box[:2] + box[2:]) / 2, np.maximum((box[2:] - box[:2]) / 2, 0.5)
    inner = (((y - centre[1]) / half[1]) ** 2)[:, None] + ((x - centre[0]) / half[0]) ** 2 < INNER**2
    framed = ((y > box[1]) & (y < box[3]))[:, None] & ((x > box[0]) & (x < box[2]))
    if not inner.any() or framed.all():
        return NO_CONTRAST
    surround = float(np.median(values[~framed]))
    noise = float(brightness.noise_dn(surround))
    excess = float(((values[inner] - surround) ** 2).mean()) - noise**2
    dn = float(np.sqrt(max(excess, 0.0)))
    return Contrast(dn, dn / noise)


def visible_labels(
    labels: list[Label],
    key: PhotoKey,
    brightness: Brightness | None,
    min_exposures: MinExposures,
    options: LabelsOptions,
) -> list[Label]:
    """Return the labels of a bracket that are visible in one of its photos.

    Visibility follows from the contrast; without `brightness`, from the minimum exposures of annotators.
    """
    if brightness is None:
        return labels_by_exposure(labels, key, min_exposures)
    measured = [label_contrast(brightness, label.box, key.exposure_ms) for label in labels]
    return [
        label
        for label, contrast in zip(labels, measured, strict=True)
        if contrast.snr >= options.min_contrast_snr and contrast.dn >= options.min_contrast_dn
    ]


def labels_by_exposure(labels: list[Label], key: PhotoKey, min_exposures: MinExposures) -> list[Label]:
    """Return the labels that annotators draw at the exposure of a photo.

    Sun lamp: rocks always, shadows from the minimum exposure. Rover light: all from its minimum exposure
    upwards. No lamp: all labels from the minimum exposure of the position upwards, if the position has one.
    """
    if is_unlit(key.light, key.azimuth):
        return labels if min_exposures.has_unlit_labels(key) else []
    if not key.has_sun:
        return labels if key.exposure_ms >= min_exposures.rig_lamp_ms else []
    dark = key.exposure_ms < min_exposures.of_shadows(key)
    return [label for label in labels if not (dark and label.kind == SHADOW)]

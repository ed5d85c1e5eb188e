"""Sun lamps refined on photos: how far windows of a shaded view lie off, and how far a moved lamp moves them.

The survey is decimetres off, which moves the tip of a rock's shadow by centimetres. A lamp's direction is found, its
distance is not: that hardly moves a shadow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.cameras.adjust import Noise, outlier_weights
from polarsim.cameras.patches import Found, Window, find
from polarsim.cameras.pictures import Pictures, read_shrunk
from polarsim.cameras.shading import Surface, shade
from polarsim.formats.rigs import PlacedRig
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

ROUNDS = 3  # of shading anew at the lamp that was found
_NUDGE = 0.04  # metres: about a pixel of a coarse view
_WEIGHTS = 20  # steps of a robust fit
_LEAST_WINDOWS = 30


@dataclass(frozen=True)
class Shot:
    """One view of a lamp's light: its camera, and its photo shrunk to the size of that lens."""

    pose: Pose
    lens: Lens
    photo: np.ndarray  # (h, w) float32 grey values


def shots_of(placed: Mapping[str, PlacedRig], pictures: Pictures, azimuth: str, scale: float) -> list[Shot]:
    """What shows a lamp's light: the left camera's photos, of cameras that photos have placed."""
    shots = []
    for (position, camera), shown in sorted(pictures.items()):
        if camera != "L" or azimuth not in shown or not placed[position].method.endswith("photos"):
            continue
        lens = placed[position].rig.lens(camera).scaled(scale)
        shots.append(Shot(placed[position].sandbox_from(camera), lens, read_shrunk(shown[azimuth], lens)))
    return shots


def refine_lamp(
    surface: Surface, surveyed: np.ndarray, survey_sd: float, shots: list[Shot], window: Window, noise: Noise
) -> np.ndarray | None:
    """(3,) place of a lamp, found across the line to the sandbox's middle; None where photos show too little of it.

    Parameters
    ----------
    surveyed, survey_sd : (3,) and float
        Where the survey has it, and the standard deviation of that, metres.
    noise : Noise
        Of windows, in pixels of the shaded view.
    """
    across = _across(surveyed)
    moved = np.zeros(2)
    for _ in range(ROUNDS):
        lamp = surveyed + moved @ across
        parts = [_responses(surface, lamp, across, shot, window) for shot in shots]
        off = np.concatenate([np.zeros((0, 2)), *(part[0] for part in parts)])
        slopes = np.concatenate([np.zeros((0, 2, 2)), *(part[1] for part in parts)])
        if len(off) < _LEAST_WINDOWS:
            return None
        moved = _fitted(moved, off, slopes, survey_sd, noise)
    return np.asarray(surveyed + moved @ across)


def _across(place: np.ndarray) -> np.ndarray:
    """(2, 3) unit vectors across the line from a lamp to the sandbox's middle: level, and upright."""
    side = np.array([place[1], -place[0], 0.0])
    return np.stack([side / np.linalg.norm(side), [0.0, 0.0, 1.0]])


def _responses(
    surface: Surface, lamp: np.ndarray, across: np.ndarray, shot: Shot, window: Window
) -> tuple[np.ndarray, np.ndarray]:
    """How far windows lie off in the photo, (n, 2) px, and how they move with the lamp, (n, 2, 2) px a metre."""
    lamps = {"here": lamp, "aside": lamp + _NUDGE * across[0], "above": lamp + _NUDGE * across[1]}
    shaded = shade(surface, shot.pose, shot.lens, lamps)
    here = shaded.images["here"]
    pictures = [shot.photo, *(_as_photo(shaded.images[name]) for name in ("aside", "above"))]
    moves = [_moves(find(here, picture, shaded.met, window)) for picture in pictures]
    common = sorted(set.intersection(*(set(one) for one in moves)))
    off, aside, above = (np.array([one[place] for place in common]).reshape(-1, 2) for one in moves)
    return off, np.stack([aside, above], axis=-1) / _NUDGE


def _as_photo(image: np.ndarray) -> np.ndarray:
    """Radiance as grey values, far from both ends of their range."""
    return np.asarray(BLACK_LEVEL + image * (0.5 * WHITE_LEVEL / max(float(image.max()), 1e-12)))


def _moves(found: Found) -> dict[tuple[float, ...], np.ndarray]:
    return {tuple(pixel): move for pixel, move in zip(found.pixel.tolist(), found.seen - found.pixel, strict=True)}


def _fitted(moved: np.ndarray, off: np.ndarray, slopes: np.ndarray, survey_sd: float, noise: Noise) -> np.ndarray:
    """(2,) how far the lamp stands from its survey across the line, m, by weights that outliers lose (Cauchy's)."""
    step = np.zeros(2)
    prior = np.eye(2) / survey_sd**2
    for _ in range(_WEIGHTS):
        weights = outlier_weights(off - slopes @ step, noise)
        normal = np.einsum("nki,n,nkj->ij", slopes, weights, slopes) + prior
        step = np.linalg.solve(normal, np.einsum("nki,n,nk->i", slopes, weights, off) - prior @ moved)
    return moved + step

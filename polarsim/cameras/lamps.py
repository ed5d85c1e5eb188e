"""Sun lamps refined on photos: how far windows of a shaded view lie off, and how far a moved lamp moves them.

The survey is decimetres off, which moves the tip of a rock's shadow by centimetres. A lamp's direction is found, its
distance is not: that hardly moves a shadow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.cameras.adjust import outlier_weights, whitened
from polarsim.cameras.shading import Seen, Surface, look
from polarsim.geometry.patches import MatchedWindows, Window, find
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PositionCamera
from polarsim.run_files.best_photos import Photos
from polarsim.run_files.rigs import LocalisedRig

_NUDGE = 0.04  # metres: about a pixel of a coarse view
_WEIGHTS = 20  # steps of a robust fit
_SURVEY_SD = 0.15  # metres: prior on a lamp's position about the survey
_LEAST_WINDOWS = 30
_LEAST_SHARE = 0.1  # of a window that must lie in shadow, and in light


@dataclass(frozen=True)
class Shot:
    """One view of a lamp's light: what its rays meet, and its photo, (h, w) float32 grey values of the same size."""

    seen: Seen
    photo: np.ndarray


def shots_of(
    surface: Surface, localised: Mapping[str, LocalisedRig], photos: Mapping[PositionCamera, Photos], scale: float
) -> dict[str, list[Shot]]:
    """What shows the light of each Sun lamp, by azimuth: the left cameras' photos, shrunk by a scale."""
    shots: dict[str, list[Shot]] = {}
    for (position, camera), shown in sorted(photos.items()):
        if camera != "L" or position not in localised:
            continue
        seen = look(surface, localised[position].camera(camera).scaled(scale))
        for azimuth, photo in shown.items():
            shots.setdefault(azimuth, []).append(Shot(seen, photo))
    return shots


def refine_lamp(
    start: np.ndarray, surveyed: np.ndarray, shots: list[Shot], window: Window, independent: int
) -> np.ndarray | None:
    """(3,) position of a lamp, found across the line to the sandbox's centre; None where photos show too little of it.

    One linear step: shadows move evenly with a lamp.

    Parameters
    ----------
    start, surveyed : (3,) float
        Where the lamp is looked for, and where the survey has it, metres.
    independent : int
        How many windows of a view at most count: neighbours err alike.
    """
    across = _across(surveyed)
    moved = across @ (start - surveyed)
    parts = [_responses(surveyed + moved @ across, across, shot, window) for shot in shots]
    off = np.concatenate([np.zeros((0, 2)), *(part[0] for part in parts)])
    slopes = np.concatenate([np.zeros((0, 2, 2)), *(part[1] for part in parts)])
    if len(off) < _LEAST_WINDOWS:
        return None
    moved = _fitted(moved, off, slopes, independent * len(shots))
    return np.asarray(surveyed + moved @ across)


def _across(position: np.ndarray) -> np.ndarray:
    """(2, 3) unit vectors across the line from a lamp to the sandbox's centre: level, and upright."""
    side = np.array([position[1], -position[0], 0.0])
    return np.stack([side / np.linalg.norm(side), [0.0, 0.0, 1.0]])


def _responses(lamp: np.ndarray, across: np.ndarray, shot: Shot, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """How far windows lie off in the photo, (n, 2), and how they move with the lamp, (n, 2, 2) a metre: whitened."""
    here = shot.seen.under(lamp)
    usable = shot.seen.hit & _on_shadow_edges(here, window)
    in_photo = find(here, shot.photo, usable, window)
    nudged = [_moves(find(here, _as_photo(shot.seen.under(lamp + nudge)), usable, window)) for nudge in _NUDGE * across]
    pixels = [tuple(pixel) for pixel in in_photo.pixel.tolist()]
    rows = [row for row, at in enumerate(pixels) if all(at in moves for moves in nudged)]
    slopes = [[moves[pixels[row]] for row in rows] for moves in nudged]
    whitening = in_photo.whitening[rows]
    return (
        whitened((in_photo.seen - in_photo.pixel)[rows], whitening),
        whitening @ np.moveaxis(np.array(slopes).reshape(2, -1, 2), 0, -1) / _NUDGE,
    )


def _on_shadow_edges(image: np.ndarray, window: Window) -> np.ndarray:
    """(h, w) bool: where a window would show shadow and light; what else it shows tells little of a lamp's position."""
    import cv2

    size = 2 * window.half + 1
    dark = cv2.blur((image == 0).astype(np.float32), (size, size))
    return np.asarray((dark > _LEAST_SHARE) & (dark < 1 - _LEAST_SHARE))


def _as_photo(image: np.ndarray) -> np.ndarray:
    """Radiance as grey values, far from both ends of their range."""
    return np.asarray(BLACK_LEVEL + image * (0.5 * WHITE_LEVEL / max(float(image.max()), 1e-12)))


def _moves(found: MatchedWindows) -> dict[tuple[float, ...], np.ndarray]:
    return {tuple(pixel): move for pixel, move in zip(found.pixel.tolist(), found.seen - found.pixel, strict=True)}


def _fitted(moved: np.ndarray, off: np.ndarray, slopes: np.ndarray, independent: int) -> np.ndarray:
    """(2,) how far the lamp stands from its survey across the line, m, by weights that outliers lose (Cauchy's)."""
    step = np.zeros(2)
    prior = np.eye(2) / _SURVEY_SD**2
    for _ in range(_WEIGHTS):
        weights = outlier_weights(off - slopes @ step, independent)
        normal = np.einsum("nki,n,nkj->ij", slopes, weights, slopes) + prior
        step = np.linalg.solve(normal, np.einsum("nki,n,nk->i", slopes, weights, off) - prior @ moved)
    return moved + step

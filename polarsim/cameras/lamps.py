"""Positions of Sun lamps from photos: offsets of windows in shaded views, and their derivatives by the lamp's position.

The survey has errors of decimetres, which move the tip of a rock's shadow by centimetres. Only the direction of a lamp
can be estimated, because its distance hardly changes a shadow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.cameras.adjust import outlier_weights, whiten
from polarsim.cameras.shading import MeshSurface, ViewHits, cast_view
from polarsim.geometry.patches import MatchedWindows, MatchingOptions, match_windows
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PositionCamera
from polarsim.run_files.best_photos import ViewPhotos
from polarsim.run_files.lamps import error_scale, is_directional
from polarsim.run_files.rigs import LocalisedRig

_DIFFERENCE_STEP = 0.04  # metres: step of numeric derivatives, about a pixel of a coarse view
_WEIGHTS = 20  # number of steps of a robust fit
_SURVEY_SD = 0.15  # metres: prior of a lamp's position about its survey
_MIN_WINDOWS = 30
# Minimum share of the windows on shadow edges that match the photos of a lamp. On the analog's terrains 1, 3 and 11,
# 0.48 to 0.76 with the surveyed lamp; 0.05 to 0.11 in photos under lamps at other sides, 0.42 for azimuth 30 named 350,
# and 0.02 to 0.04 in photos of another terrain; on smooth sand 0.05 to 0.14 with any lamp. On twelve published cover
# photos, whose meshes were placed by hand, 0.20 to 0.72 with the surveyed lamp and at most 0.09 with the opposite lamp.
_MIN_MATCHED = 0.15
_MIN_TRIED = 100  # minimum number of windows on shadow edges for this test
_MIN_SHARE = 0.1  # minimum share of a window in shadow, and in light


@dataclass(frozen=True)
class LampView:
    """Ray hits of a view, and its photo under one lamp, (h, w) float32 grey values of the same size."""

    hits: ViewHits
    photo: np.ndarray


def lamp_views(
    surface: MeshSurface,
    localised: Mapping[str, LocalisedRig],
    photos: Mapping[PositionCamera, ViewPhotos],
    scale: float,
) -> dict[str, list[LampView]]:
    """Return the shrunk photos of the left cameras for each Sun lamp, by azimuth."""
    views: dict[str, list[LampView]] = {}
    for (position, camera), shown in sorted(photos.items()):
        if camera != "L" or position not in localised:
            continue
        hits = cast_view(surface, localised[position].camera(camera).scaled(scale))
        for azimuth, photo in shown.items():
            views.setdefault(azimuth, []).append(LampView(hits, photo))
    return views


def lamps_elsewhere(
    views: Mapping[str, list[LampView]], surveyed: Mapping[str, np.ndarray], window: MatchingOptions
) -> dict[str, float]:
    """Return the lamps whose photos do not show the predicted shadows, with the share of matched windows.

    The meshes must resemble photos: those of other lamps, or the same photos under another surveyed lamp. Otherwise, as
    on smooth sand, few matches do not indicate another lamp. `surveyed`: positions (3,) by azimuth.
    """
    shares = {azimuth: _matched_share(of, surveyed[azimuth], window) for azimuth, of in sorted(views.items())}
    are_similar = any(share >= _MIN_MATCHED for share in shares.values())

    def under_another(azimuth: str) -> bool:
        others = (_matched_share(views[azimuth], surveyed[other], window) for other in surveyed if other != azimuth)
        return any(share >= max(_MIN_MATCHED, 2 * shares[azimuth]) for share in others)

    return {
        azimuth: share
        for azimuth, share in shares.items()
        if share < _MIN_MATCHED and (are_similar or under_another(azimuth))
    }


def _matched_share(views: list[LampView], lamp: np.ndarray, window: MatchingOptions) -> float:
    """Return the share of the windows on the shadow edges of a lamp (3,) that match photos; NaN for few windows."""
    tried = matched = 0
    for view in views:
        shaded = view.hits.shade(lamp)
        windows = match_windows(shaded, view.photo, view.hits.hit & _on_shadow_edges(shaded, window), window)
        tried, matched = tried + windows.tried, matched + len(windows.pixel)
    return matched / tried if tried >= _MIN_TRIED else float("nan")


def refine_lamp(
    start: np.ndarray, surveyed: np.ndarray, views: list[LampView], window: MatchingOptions, independent: int
) -> np.ndarray | None:
    """Return the position (3,) of a lamp, moved across the line to the sandbox's centre; None with too few windows.

    A single linear step suffices, because shadows move in proportion to the lamp.

    `start`, `surveyed` (3,): start of the fit, and surveyed position, metres.
    `independent`: maximum weight of a view, in windows: the errors of neighbouring windows are correlated.
    """
    axes = across(surveyed)
    moved = axes @ (start - surveyed)
    scale = error_scale(surveyed)
    parts = [_responses(surveyed + moved @ axes, axes, view, window, scale) for view in views]
    off = np.concatenate([np.zeros((0, 2)), *(part[0] for part in parts)])
    slopes = np.concatenate([np.zeros((0, 2, 2)), *(part[1] for part in parts)])
    if len(off) < _MIN_WINDOWS:
        return None
    moved = _fit_offset(moved, off, slopes, independent * len(views), scale)
    return np.asarray(surveyed + moved @ axes)


def offset_text(first: np.ndarray, second: np.ndarray) -> str:
    """Return the distance of two positions of a lamp, or the angle of two directions."""
    if is_directional(first):
        cosine = first @ second / (np.linalg.norm(first) * np.linalg.norm(second))
        return f"{np.degrees(np.arccos(min(float(cosine), 1.0))):.2f} degrees"
    return f"{1000 * np.linalg.norm(first - second):.0f} mm"


def across(position: np.ndarray) -> np.ndarray:
    """Return (2, 3) unit vectors across the line from a lamp to the sandbox's centre: level, and upright.

    For a directional lamp, the second vector is perpendicular to the line.
    """
    side = np.array([position[1], -position[0], 0.0])
    if not side.any():  # the lamp is above the centre
        return np.eye(3)[:2]
    side /= np.linalg.norm(side)
    up = np.cross(side, position / np.linalg.norm(position)) if is_directional(position) else np.array([0.0, 0.0, 1.0])
    return np.stack([side, up])


def _responses(
    lamp: np.ndarray, axes: np.ndarray, view: LampView, window: MatchingOptions, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return whitened offsets of windows in the photo, (n, 2), and their derivatives by the lamp, (n, 2, 2) a metre."""
    shaded = view.hits.shade(lamp)
    usable = view.hits.hit & _on_shadow_edges(shaded, window)
    in_photo = match_windows(shaded, view.photo, usable, window)
    nudged = [
        _moves(match_windows(shaded, _as_photo(view.hits.shade(lamp + nudge)), usable, window))
        for nudge in scale * _DIFFERENCE_STEP * axes
    ]
    pixels = [tuple(pixel) for pixel in in_photo.pixel.tolist()]
    rows = [row for row, at in enumerate(pixels) if all(at in moves for moves in nudged)]
    slopes = [[moves[pixels[row]] for row in rows] for moves in nudged]
    whitening = in_photo.whitening[rows]
    return (
        whiten((in_photo.seen - in_photo.pixel)[rows], whitening),
        whitening @ np.moveaxis(np.array(slopes).reshape(2, -1, 2), 0, -1) / (scale * _DIFFERENCE_STEP),
    )


def _on_shadow_edges(image: np.ndarray, window: MatchingOptions) -> np.ndarray:
    """Return a mask (h, w) of windows that contain shadow and light; other windows hardly depend on the lamp."""
    import cv2

    size = 2 * window.half + 1
    dark = cv2.blur((image == 0).astype(np.float32), (size, size))
    return np.asarray((dark > _MIN_SHARE) & (dark < 1 - _MIN_SHARE))


def _as_photo(image: np.ndarray) -> np.ndarray:
    """Scale radiance to grey values in the middle of their range."""
    return np.asarray(BLACK_LEVEL + image * (0.5 * WHITE_LEVEL / max(float(image.max()), 1e-12)))


def _moves(windows: MatchedWindows) -> dict[tuple[float, ...], np.ndarray]:
    return {
        tuple(pixel): move for pixel, move in zip(windows.pixel.tolist(), windows.seen - windows.pixel, strict=True)
    }


def _fit_offset(moved: np.ndarray, off: np.ndarray, slopes: np.ndarray, independent: int, scale: float) -> np.ndarray:
    """Return the offset (2,) of a lamp from its survey across the line, m, by a fit with Cauchy weights."""
    step = np.zeros(2)
    prior = np.eye(2) / (scale * _SURVEY_SD) ** 2
    for _ in range(_WEIGHTS):
        weights = outlier_weights(off - slopes @ step, independent)
        normal = np.einsum("nki,n,nkj->ij", slopes, weights, slopes) + prior
        step = np.linalg.solve(normal, np.einsum("nki,n,nk->i", slopes, weights, off) - prior @ moved)
    return moved + step

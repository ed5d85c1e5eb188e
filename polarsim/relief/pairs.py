"""Views with comparable patterns: the same Sun lamp, or lamps in similar or opposite directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from polarsim.photo import PhotoKey
from polarsim.relief.heights import PhotoView

SIMILAR_DEG = 40.0  # maximum angle between lamps whose shading is similar; the opposite is opposite


@dataclass(frozen=True)
class Group:
    """Views whose patterns of light and dark are compared."""

    signs: Mapping[PhotoKey, float]  # 1, or -1 for a view whose shading is inverted
    shadows_hidden: frozenset[PhotoKey] = frozenset()  # views whose cast shadows are ignored, because the Suns differ


def comparable_groups(views: Sequence[PhotoView]) -> list[Group]:
    """Return a group of all views for each azimuth that several cameras show.

    Without such an azimuth, return each pair of views from different cameras with similar or opposite lamps.
    """
    groups = []
    for azimuth in sorted({view.key.azimuth for view in views}):
        chosen = [view.key for view in views if view.key.azimuth == azimuth]
        if len({key.view for key in chosen}) > 1:
            groups.append(Group(dict.fromkeys(chosen, 1.0)))
    if groups:
        return groups
    for first, second in combinations(views, 2):
        sign = _sign(first.lamp_m, second.lamp_m)
        if first.key.view != second.key.view and sign:
            keys = first.key, second.key
            groups.append(Group(dict(zip(keys, (1.0, sign), strict=True)), frozenset(keys)))
    return groups


def _sign(first: np.ndarray, second: np.ndarray) -> float:
    """Return 1 for lamps (3,) in similar horizontal directions from the origin, -1 for opposite ones, otherwise 0."""
    cosine = float(first[:2] @ second[:2] / (np.linalg.norm(first[:2]) * np.linalg.norm(second[:2])))
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return 1.0 if angle <= SIMILAR_DEG else -1.0 if angle >= 180.0 - SIMILAR_DEG else 0.0

"""Agreement of feature matches between a photo and the twin, which have the same camera and pose.

A program that navigates by matching features finds the right place only if features of the twin match the features of
the photo at the same pixels. SIFT features (Lowe, IJCV 60 (2004) 91) of the compared part of both images are matched; a
match agrees if both positions coincide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.features import Features, match_features, sift_features

TOLERANCE_PX = 1.0  # maximum distance of an agreeing match, pixels of the reduced images (4 px of a photo)
_MAX_FEATURES = 2000  # maximum number of features of an image
_FILL_PX = 3  # radius of the neighbourhood that fills ignored pixels


@dataclass(frozen=True)
class FeatureAgreement:
    """Matches of features between a photo and the twin."""

    matches: int
    agreement: float  # share of the matches that agree; NaN without matches
    agreement_by_chance: float  # the same share if positions were matched at random; NaN with less than two matches


def find_features(picture: np.ndarray, valid: np.ndarray) -> Features:
    """Return the features of an image (h, w) float32, grey values 0 to 255, at `valid` pixels (h, w) bool."""
    import cv2

    grey = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    if not valid.all():
        grey = cv2.inpaint(
            np.where(valid, grey, 0).astype(np.uint8), (~valid).astype(np.uint8), _FILL_PX, cv2.INPAINT_TELEA
        )
    found = sift_features(grey, _MAX_FEATURES)
    columns, rows = np.floor(found.pixels).astype(int).T
    kept = valid[rows, columns]
    return Features(found.pixels[kept], found.descriptors[kept])


def compare_features(photo: Features, twin: Features) -> FeatureAgreement:
    """Return the agreement of the matches between the features of a photo and of the twin."""
    first, second = match_features(photo, twin)
    return agreement_of(photo.pixels[first], twin.pixels[second])


def agreement_of(photo: np.ndarray, twin: np.ndarray) -> FeatureAgreement:
    """Return the agreement of matches between pixels (n, 2) of the photo and (n, 2) of the twin.

    The share by chance is that of all pairs of a photo's position with the twin's position of another match.
    """
    count = len(photo)
    near = np.linalg.norm(photo[:, None] - twin[None], axis=-1) <= TOLERANCE_PX
    agreeing = int(np.trace(near))
    return FeatureAgreement(
        count,
        agreeing / count if count else float("nan"),
        (int(near.sum()) - agreeing) / (count * (count - 1)) if count > 1 else float("nan"),
    )

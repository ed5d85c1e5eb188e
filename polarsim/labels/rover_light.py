"""Which rocks people draw where only the rover's light shines: it fades with distance, and small rocks go first.

Logistic in what people drew under Sun lamps, in size and in distance. The coefficients were fitted by
`benchmarks/transfers.py --fit` to the photos of terrains 03, 04, 08, 11, 12 of the published labels without a Sun lamp;
it also prints what coefficients fitted to the other terrains do on each.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

TERMS = ("all", "share here", "share elsewhere", "small", "far m")
COEFFICIENTS = (2.64, 2.23, 1.65, 1.78, -0.65)
PRESENCE = 0.45  # least probability of a label: F1 is highest where labels that are right less often than half of it go
LARGE_PX = 50.0  # sqrt(area) from which on size does not matter
USUAL_M = 3.5  # distance of the centre of the sandbox, about


def terms(share: float, elsewhere: float, size_px: float, distance_m: float) -> np.ndarray:
    """(len(TERMS),) what the logarithm of the odds is linear in.

    Parameters
    ----------
    share, elsewhere
        Of the drawings under Sun lamps, those that show the rock: at the photo's position, and at others.
    size_px
        sqrt(width * height) of the label.
    distance_m
        From the camera to the rock.
    """
    small = min(np.log(max(size_px, 1.0) / LARGE_PX), 0.0)
    return np.array([1.0, share - 1, elsewhere - 1, small, distance_m - USUAL_M])


def probability(terms: np.ndarray, coefficients: Sequence[float] = COEFFICIENTS) -> float:
    """Probability that a person drew a rock of some `terms` (t,), by a box that the label's overlaps by IoU >= 0.5."""
    return float(1 / (1 + np.exp(-terms @ np.asarray(coefficients))))

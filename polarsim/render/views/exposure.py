"""The exposure at which the lit part of a picture gets a stated brightness."""

from __future__ import annotations

import numpy as np

from polarsim.photo import BLACK_LEVEL
from polarsim.render.views.sections import AutoExposure

_LIT = 0.25  # of the median radiance: darker pixels lie in shadow or half-shadow


def auto_exposure(radiance: np.ndarray, gain: float, options: AutoExposure) -> float:
    """Exposure, ms, that gives the percentile of the lit pixels of a radiance (h, w) the stated grey value.

    Of a picture without light it is the longest. `gain`: grey values per ms and unit radiance.
    """
    positive = radiance[radiance > 0]
    if not len(positive):
        return options.longest_ms
    lit = positive[positive > _LIT * np.median(positive)]
    exposure = (options.grey - BLACK_LEVEL) / (gain * float(np.percentile(lit, options.percentile)))
    return float(f"{np.clip(exposure, options.shortest_ms, options.longest_ms):.6g}")

"""Units of the bootstrap of detectors, views or photos, and average precision of resamples; see `polarsim.intervals`.

Photos of one view show the same rocks from the same position under other light: they are not independent, and intervals
over photos come out too narrow. Views of one terrain show the same rocks too, from elsewhere; few terrains are tested,
so intervals say how sure a figure is of these terrains, not of another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from polarsim.errors import DetectError, LabelError
from polarsim.photo import PhotoKey

Unit = Literal["view", "photo"]


def units_of(keys: Sequence[str], unit: Unit) -> np.ndarray:
    """(n,) number of each photo's view, from 0, in the order of the views; or of each photo.

    Raises
    ------
    DetectError
        Views are asked for, and a name is no photo key.
    """
    if unit == "photo":
        return np.unique(np.array(keys, str), return_inverse=True)[1]
    try:
        views = [PhotoKey.parse(key).view for key in keys]
    except LabelError as error:
        raise DetectError(f"{error}, so its view is not known: draw photos instead") from error
    number = {view: n for n, view in enumerate(sorted(set(views)))}
    return np.array([number[view] for view in views], int)

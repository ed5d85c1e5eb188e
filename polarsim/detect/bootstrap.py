"""Units of the bootstrap of detector metrics: views or photos; see `polarsim.intervals`.

Photos of a view show the same rocks from the same position under different light. They are not independent, so
intervals over photos are too narrow. Views of a terrain also share rocks. Because few terrains are tested, intervals
are valid for these terrains only and do not extend to new terrains.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from polarsim.errors import DetectError, LabelError
from polarsim.photo import PhotoKey

Unit = Literal["view", "photo"]


def units_of(keys: Sequence[str], unit: Unit) -> np.ndarray:
    """Return the index (n,) of the view of each photo in the sorted views; or of each photo.

    Raises
    ------
    DetectError
        `unit` is `view` and a name is not a photo key.
    """
    if unit == "photo":
        return np.unique(np.array(keys, str), return_inverse=True)[1]
    try:
        views = [PhotoKey.parse(key).view for key in keys]
    except LabelError as error:
        raise DetectError(f"{error}, so the view is unknown: use photos as bootstrap units") from error
    number = {view: n for n, view in enumerate(sorted(set(views)))}
    return np.array([number[view] for view in views], int)

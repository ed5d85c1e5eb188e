"""Where a view shows the sandbox's ground, and where what lies around it."""

from __future__ import annotations

import numpy as np

from polarsim.labels.shadows import Ids
from polarsim.labels.shapes import Shape

SMALL_REGION = 400  # px: smaller pieces of ground or background are not worth a polygon
THIN_PX = 2  # neither are pieces that are narrower


def backdrop(ids: Ids, simplify_px: float) -> list[tuple[str, np.ndarray]]:
    """Rings (n, 2) of background and of ground, which goes on below rocks and shadows."""
    import cv2

    ground = np.zeros(ids.shape, np.uint8)
    seen = ids.hit.astype(np.uint8)
    lines, _ = cv2.findContours(seen, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(ground, [line for line in lines if cv2.contourArea(line) >= SMALL_REGION], -1, 1, cv2.FILLED)
    rings = [
        (name, ring)
        for name, mask in (("background", ground == 0), ("ground", ground == 1))
        for ring in Shape(mask, 0, 0).rings(simplify_px)
    ]
    return [(name, ring) for name, ring in rings if np.ptp(ring, axis=0).min() >= THIN_PX]

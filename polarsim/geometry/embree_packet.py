"""Layout of a packet of rays, Embree's RTCRayHit8 or RTCRayHit16 (embree4/rtcore_ray.h).

A packet has 24 rows of 8 or 16 numbers of four bytes, aligned to the row size.
"""

from __future__ import annotations

import numpy as np

ORIGIN, NEAR, DIRECTION, TIME, FAR, MASK, NUMBER, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11  # rows of a packet
NORMAL, WEIGHTS, FACE, SHAPE, INSTANCE, ROWS = 12, 15, 17, 18, 19, 24
NOTHING = np.uint32(0xFFFFFFFF)  # RTC_INVALID_GEOMETRY_ID
# RTCIntersectArguments: rays near each other, all features, no context, no filter, no user function.
COHERENT = np.array([1 << 16, 0xFFFFFFFF, 0, 0, 0, 0, 0, 0], np.uint32)

"""Test image that every rock detector should handle: bright lumps with black shadows on noisy grey sand."""

import numpy as np

CENTRES = np.array([(150 + 200 * column, 200 + 130 * row) for row in range(3) for column in range(4)])


def lit_lumps() -> np.ndarray:
    """Return an image (608, 968) uint8 of twelve lumps with shadows around `CENTRES`."""
    picture = 70 + 6 * np.random.default_rng(0).standard_normal((608, 968))
    y, x = np.mgrid[:608, :968]
    for cx, cy in CENTRES:
        picture[((x - cx - 38) / 40) ** 2 + ((y - cy - 6) / 10) ** 2 < 1] = 6
        lump = ((x - cx) / 22) ** 2 + ((y - cy) / 18) ** 2 < 1
        picture[lump] = 150 + 60 * np.clip((cx - x[lump]) / 22, -1, 1)
    return np.clip(picture, 0, 255).astype(np.uint8)

"""Range of the values in images: their bits, and the value of saturated pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_BITS = (8, 10, 12, 14, 16)
_SATURATED_SHARE = 1e-4  # minimum share of pixels with the largest value if they are saturated
_NEAR = 0.99  # of the largest value


def bits_of(images: Sequence[np.ndarray]) -> int:
    """Return the bits of a value of images of one type, uint8 or uint16."""
    if images[0].dtype == np.uint8:
        return 8
    largest = max(int(pixels.max()) for pixels in images)
    return next(bits for bits in _BITS[1:] if largest < 2**bits)


def saturated_value(images: Sequence[np.ndarray]) -> int | None:
    """Return the value of saturated pixels in images of one type; None if none are saturated.

    Saturated pixels use more than half of the range, and are more frequent than pixels up to 1 % darker.
    """
    largest = max(int(pixels.max()) for pixels in images)
    if largest <= 2 ** (bits_of(images) - 1):
        return None
    for pixels in images:
        count = int(np.count_nonzero(pixels == largest))
        near = int(np.count_nonzero((pixels >= _NEAR * largest) & (pixels < largest)))
        if count > max(_SATURATED_SHARE * pixels.size, near):
            return largest
    return None

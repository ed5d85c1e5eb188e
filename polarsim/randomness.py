"""Random generators: equal run seed and purpose yield equal numbers, in any order of jobs."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np  # a plan replaces negative zeros only


def generator(seed: int, *purpose: object) -> np.random.Generator:
    """Return a generator for a purpose, such as `generator(seed, "sensor", key)`; 0.0 and -0.0 are equal."""
    import numpy as np

    text = "\x1f".join(str(without_negative_zeros(part)) for part in (seed, *purpose))
    return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "big"))


def without_negative_zeros(value: Any) -> Any:
    """Replace -0.0 by 0.0 in floats, arrays, and lists, tuples and dictionaries of them; return other values unchanged.

    Both zeros are equal but differ in text and bytes, and the sign depends on rounding errors. Every part of a seed, a
    digest or a key is passed through this function.
    """
    if isinstance(value, float):
        return value + type(value)(0)
    dtype: Any = getattr(value, "dtype", None)  # of arrays and scalars of NumPy
    if getattr(dtype, "kind", "") in ("f", "c"):
        return value + dtype.type(0)
    if isinstance(value, dict):
        return {key: without_negative_zeros(part) for key, part in value.items()}
    if type(value) in (list, tuple):
        return type(value)(without_negative_zeros(part) for part in value)
    return value

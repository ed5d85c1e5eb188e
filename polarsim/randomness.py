"""The one module that makes random generators: same run seed and purpose, same numbers, in any order of jobs."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np


def generator(seed: int, *purpose: object) -> np.random.Generator:
    """A generator for a purpose, such as `generator(seed, "sensor", key)`; the sign of a zero does not count."""
    text = "\x1f".join(str(unsigned_zeros(part)) for part in (seed, *purpose))
    return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "big"))


def unsigned_zeros(value: Any) -> Any:
    """A value with 0.0 for each -0.0: floats, arrays, and lists, tuples and dictionaries of them; others as they are.

    Both zeros are equal but differ in text and bytes, and rounding errors decide which one a sum gives. Whatever
    becomes a seed, a digest or a key is passed through this function.
    """
    if isinstance(value, float | np.floating):
        return value + type(value)(0)
    if isinstance(value, np.ndarray) and value.dtype.kind in "fc":
        return value + value.dtype.type(0)
    if isinstance(value, dict):
        return {key: unsigned_zeros(one) for key, one in value.items()}
    if type(value) in (list, tuple):
        return type(value)(unsigned_zeros(one) for one in value)
    return value

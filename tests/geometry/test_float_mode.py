import platform

import numba
import numpy as np
import pytest

from polarsim.geometry.float_mode import denormals_as_zero, restore

TINY = np.float32(1e-39)  # no float32 so small has full precision


@numba.njit
def halves(number):
    """A half of a number as usual, with such numbers as zero, and as usual again."""
    half = np.float32(0.5)
    found = np.zeros(3, np.float32)
    found[0] = number[0] * half
    mode = denormals_as_zero()
    found[1] = number[1] * half
    restore(mode)
    found[2] = number[2] * half
    return found


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="needs a processor with MXCSR")
def test_numbers_without_full_precision_are_zero_between_the_two_calls_alone():
    assert (halves(np.full(3, TINY)) > 0).tolist() == [True, False, True]
    assert np.full(1, TINY)[0] * np.float32(0.5) > 0  # the caller's thread

import platform

import numba
import numpy as np
import pytest

from polarsim.geometry.float_mode import denormals_as_zero, restore

TINY = np.float32(1e-39)  # denormal float32


@numba.njit
def halves(number):
    """Return half of a number in the normal mode, with denormals as zero, and in the normal mode again."""
    half = np.float32(0.5)
    found = np.zeros(3, np.float32)
    found[0] = number[0] * half
    mode = denormals_as_zero()
    found[1] = number[1] * half
    restore(mode)
    found[2] = number[2] * half
    return found


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="needs a processor with MXCSR")
def test_denormals_are_zero_only_between_the_two_calls():
    assert (halves(np.full(3, TINY)) > 0).tolist() == [True, False, True]
    assert np.full(1, TINY)[0] * np.float32(0.5) > 0  # the caller's thread

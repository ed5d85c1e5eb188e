"""Selection of the loops over hits: compiled by Numba, or in NumPy where Numba is not installed."""

from __future__ import annotations

from types import ModuleType

from polarsim.kernels import NUMBA


def _installed() -> ModuleType:
    if NUMBA:
        from polarsim.render import hit_kernels

        return hit_kernels
    from polarsim.render import hit_arrays

    return hit_arrays


hit_kernels = _installed()

"""Selection of the loops over hits: compiled by Numba, or in NumPy where Numba is not installed."""

from __future__ import annotations

from types import ModuleType

from polarsim.kernels import NUMBA

hit_kernels: ModuleType
if NUMBA:
    from polarsim.render import hit_kernels
else:
    from polarsim.render import hit_arrays as hit_kernels  # noqa: F401

"""Compiled kernels: Numba's `njit` with a cache that depends on the code of all inlined kernels.

Numba reuses compiled code until the file of the function changes. Kernels of other files are compiled into it, so after
an edit of these files Numba would run outdated code. Therefore each version of the code has a separate cache folder,
named by the digest of the module of the function and of all modules of polarsim that it imports.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from polarsim.digest import code_digest

NUMBA = find_spec("numba") is not None  # an extra; without it, slower forms of a few kernels have the same results
_BESIDE_THE_CODE = Path(__file__).parent / "__pycache__"


def njit(*signatures: str, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator like `numba.njit` with cache; NUMBA_CACHE_DIR sets the folder of the cache."""
    import numba
    from numba.core import config

    def compiled(function: Callable[..., Any]) -> Any:
        former = config.CACHE_DIR
        config.CACHE_DIR = str(Path(former or _BESIDE_THE_CODE) / f"kernels-{code_digest(function.__module__)}")
        try:  # Numba chooses the folder while it decorates
            return numba.njit(*signatures, cache=True, **options)(function)
        finally:
            config.CACHE_DIR = former

    return compiled

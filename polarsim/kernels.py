"""Compiled kernels: Numba's `njit`, with a cache that sees edits of every kernel that one is made of.

Numba keeps compiled code for as long as the function's own file stays as it is. But kernels of other files are
compiled into it, and after an edit of these it would go on running the old ones. So each state of the code has a
cache of its own: a folder named by the digest of the function's module and all of polarsim that this imports.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config

from polarsim.digest import code_digest

_BESIDE_THE_CODE = Path(__file__).parent / "__pycache__"


def njit(*signatures: str, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator like Numba's, always cached; NUMBA_CACHE_DIR names another folder than the library's own."""

    def compiled(function: Callable[..., Any]) -> Any:
        former = config.CACHE_DIR
        config.CACHE_DIR = str(Path(former or _BESIDE_THE_CODE) / f"kernels-{code_digest(function.__module__)}")
        try:  # Numba chooses the folder while it decorates
            return numba.njit(*signatures, cache=True, **options)(function)
        finally:
            config.CACHE_DIR = former

    return compiled

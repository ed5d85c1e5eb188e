"""Lazy imports of the public names of a package, for example `from polarsim.render import Scene`.

Modules of polarsim import each other by full module names, so that a digest of code contains only the required modules
and reading a configuration does not import a renderer. The short form is for notebooks and scripts.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

Offer = tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]


def lazy_exports(package: str, **modules: str) -> Offer:
    """Return `__all__`, `__getattr__` and `__dir__` of a package with public names given as `Name="module"`."""

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{modules[name]}"), name)

    return sorted(modules), get, lambda: sorted(modules)

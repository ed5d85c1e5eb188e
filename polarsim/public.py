"""Names that a package offers, imported when they are asked for: `from polarsim.render import Scene`.

Modules import each other by their own names, so that a digest of code reaches what it needs and no more, and so that
reading a configuration does not start a renderer. Notebooks and scripts take the short way.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

Offer = tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]


def offered(package: str, **modules: str) -> Offer:
    """`__all__`, `__getattr__`, `__dir__` of a package that offers names of its modules, given as `Name="module"`."""

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{modules[name]}"), name)

    return sorted(modules), get, lambda: sorted(modules)

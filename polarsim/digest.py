"""A digest of the code that a rule really uses, so that a change of code is a change of input.

Snakemake watches the scripts of its rules, not the library behind them. Whatever finds its own files of an earlier
call, such as kernels, drives, views and trainings, keeps it beside them.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parent


def code_digest(*modules: str) -> str:
    """Digest of modules, such as `polarsim.cameras.locate`, and of all of polarsim that they import, at any depth.

    Comments, docstrings and layout do not count.
    """
    total = hashlib.sha256()
    for name in sorted(_reached(modules)):
        total.update(f"{name}:{_module_digest(name)};".encode())
    return total.hexdigest()[:16]


def _reached(modules: tuple[str, ...]) -> set[str]:
    reached: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += imported_modules(name)
    return reached


@cache
def imported_modules(name: str) -> tuple[str, ...]:
    """The modules of polarsim that a module imports, inside functions too."""
    found = set()
    for node in ast.walk(_tree(name)):
        if isinstance(node, ast.Import):
            candidates = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            candidates = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        found |= {candidate for candidate in candidates if _file(candidate)}
    return tuple(sorted(found))


@cache
def _module_digest(name: str) -> str:
    return hashlib.sha256(ast.dump(_without_docstrings(_tree(name))).encode()).hexdigest()


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return tree


def _tree(name: str) -> ast.Module:
    path = _file(name)
    if path is None:
        raise ModuleNotFoundError(name)
    return ast.parse(path.read_text(encoding="utf-8"))


def _file(name: str) -> Path | None:
    if name.split(".")[0] != "polarsim":
        return None
    place = _PACKAGE.joinpath(*name.split(".")[1:])
    for path in (place.with_suffix(".py"), place / "__init__.py"):
        if path.is_file():
            return path
    return None

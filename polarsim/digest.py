"""A digest of the code that a rule really uses, so that a change of code is a change of input.

Snakemake watches the scripts of its rules, not the library behind them. Whatever finds its own files of an earlier
call, such as kernels, drives, views and trainings, keeps it beside them.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parent
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)


def code_digest(*modules: str) -> str:
    """Digest of modules, such as `polarsim.cameras.locate`, and of all of polarsim that they import, at any depth.

    Comments, docstrings and layout do not count.
    """
    return _digest({name: _module(name)[0] for name in _reached(modules)})


def script_digest(path: str | Path) -> str:
    """Digest of a script and of all of polarsim that it imports, at any depth; as `code_digest`."""
    own, imported = _parsed(Path(path))
    return _digest({"": own} | {name: _module(name)[0] for name in _reached(imported)})


def imported_modules(name: str) -> tuple[str, ...]:
    """The modules of polarsim that a module imports.

    Imports inside functions count too: engines are imported where a configuration asks for them, and which one that is
    the code alone does not say. So an edit of one engine re-runs what may use it, rather than too little. A package
    counts where a name that is no module of it is imported from it: packages hold nothing but names of their modules.
    """
    return _module(name)[1]


def _digest(parts: dict[str, str]) -> str:
    total = hashlib.sha256()
    for name, part in sorted(parts.items()):
        total.update(f"{name}:{part};".encode())
    return total.hexdigest()[:16]


def _reached(modules: Iterable[str]) -> set[str]:
    reached: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += imported_modules(name)
    return reached


@cache
def _module(name: str) -> tuple[str, tuple[str, ...]]:
    path = _file(name)
    if path is None:
        raise ModuleNotFoundError(name)
    return _parsed(path)


def _parsed(path: Path) -> tuple[str, tuple[str, ...]]:
    """Digest of a file's code, and the modules of polarsim that it imports: to parse is what takes the time."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = _imports(tree)
    return hashlib.sha256(ast.dump(_without_docstrings(tree)).encode()).hexdigest(), imported


def _imports(tree: ast.Module) -> tuple[str, ...]:
    found: set[str] = set()
    for node in _statements(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            within = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if _file(name) else node.module for name in within}
    return tuple(sorted(name for name in found if _file(name)))


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in _statements(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
    return tree


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """The module and every statement in it, at any depth; not expressions, which are most of a tree's nodes."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, part, ())


@cache
def _file(name: str) -> Path | None:
    if name.split(".")[0] != "polarsim":
        return None
    below = _PACKAGE.joinpath(*name.split(".")[1:])
    for path in (below.with_suffix(".py"), below / "__init__.py"):
        if path.is_file():
            return path
    return None

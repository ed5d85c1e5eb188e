"""Digests of the code that a rule uses, so that a change of code is a change of input.

Snakemake tracks the scripts of rules, but not the modules that they import. Steps that resume from files of earlier
calls (kernels, drives, views, trainings) store the digest next to these files.

Parsing all files takes two seconds, so the result of each file is cached next to the bytecode until the file changes.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path

_PACKAGE = Path(__file__).parent
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)
_Names = list[tuple[str, list[str]]]  # (imported module, names imported from it)


def code_digest(*modules: str) -> str:
    """Return the digest of modules, such as `polarsim.cameras.locate`, and of all modules of polarsim that they import.

    Imports are followed at any depth. Comments, docstrings and layout are ignored.
    """
    return _digest({name: _module(name)[0] for name in _reached(modules)})


def script_digest(path: str | Path) -> str:
    """Return the digest of a script and of all modules of polarsim that it imports, as `code_digest`."""
    own, imported = _parsed(Path(path))
    return _digest({"": own} | {name: _module(name)[0] for name in _reached(imported)})


def imported_modules(name: str) -> tuple[str, ...]:
    """Return the modules of polarsim that a module imports.

    Imports inside functions are included: the configuration selects the engine, so the code does not show which engine
    is used, and an edit of an engine must repeat every job that may use it. A package is included if a name that is not
    one of its modules is imported from it.
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
    code, imported = _parsed(path)
    data = path.with_suffix(".json")  # data file of the module, with the same name
    if data.is_file():
        code += hashlib.sha256(data.read_bytes()).hexdigest()
    return code, imported


def _parsed(path: Path) -> tuple[str, tuple[str, ...]]:
    """Return the digest of the code of a file, and the modules of polarsim that it imports."""
    source = path.read_bytes()
    version = hashlib.sha256(_source_of_this_module() + source).hexdigest()
    cached = Path(cache_from_source(str(path))).with_suffix(".digest")
    result = _read_cached(cached, version)
    if result is None:
        tree = ast.parse(source)
        names = _names_imported(tree)
        result = hashlib.sha256(ast.dump(_without_docstrings(tree)).encode()).hexdigest(), names
        _write_cached(cached, version, *result)
    return result[0], _imports(result[1])


@cache
def _source_of_this_module() -> bytes:
    return Path(__file__).read_bytes()


def _read_cached(path: Path, version: str) -> tuple[str, _Names] | None:
    """Return the cached result of a file; None if it is missing, incomplete or of another version."""
    try:
        content = json.loads(path.read_bytes())
        return (content["code"], content["imports"]) if content["version"] == version else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_cached(path: Path, version: str, code: str, imports: _Names) -> None:
    """Cache the result of a file with an atomic write; a read-only folder is ignored."""
    part = path.with_suffix(f".{os.getpid()}.part")
    with contextlib.suppress(OSError):
        path.parent.mkdir(exist_ok=True)
        part.write_text(json.dumps({"version": version, "code": code, "imports": imports}), encoding="utf-8")
        part.replace(path)


def _names_imported(tree: ast.Module) -> _Names:
    found: _Names = []
    for node in _statements(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, []) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append((node.module, [alias.name for alias in node.names]))
    return [(module, names) for module, names in found if module.split(".")[0] == _PACKAGE.name]


def _imports(imported: _Names) -> tuple[str, ...]:
    """Return the imported modules: an imported name is a module if a file of this name exists."""
    found: set[str] = set()
    for module, names in imported:
        below = {f"{module}.{name}" for name in names}
        found |= {name if _file(name) else module for name in below} or {module}
    return tuple(sorted(name for name in found if _file(name)))


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in _statements(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
    return tree


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield a module and every statement in it at any depth, without expressions, which are most of the nodes."""
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

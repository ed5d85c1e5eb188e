"""A digest of the code that a rule really uses, so that a change of code is a change of input.

Snakemake watches the scripts of its rules, not the library behind them. Whatever finds its own files of an earlier
call, such as kernels, drives, views and trainings, keeps it beside them.

To parse all files takes two seconds, so what is found in a file is kept beside its bytecode, until the file is edited.
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
_Names = list[tuple[str, list[str]]]  # a module that a file imports, and the names that it imports from it


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
    code, imported = _parsed(path)
    data = path.with_suffix(".json")  # coefficients of a module are a file of its name
    if data.is_file():
        code += hashlib.sha256(data.read_bytes()).hexdigest()
    return code, imported


def _parsed(path: Path) -> tuple[str, tuple[str, ...]]:
    """Digest of a file's code, and the modules of polarsim that it imports."""
    source = path.read_bytes()
    whose = hashlib.sha256(_own_source() + source).hexdigest()
    kept = Path(cache_from_source(str(path))).with_suffix(".digest")
    found = _read_kept(kept, whose)
    if found is None:
        tree = ast.parse(source)
        names = _names_imported(tree)
        found = hashlib.sha256(ast.dump(_without_docstrings(tree)).encode()).hexdigest(), names
        _keep(kept, whose, *found)
    return found[0], _imports(found[1])


@cache
def _own_source() -> bytes:
    return Path(__file__).read_bytes()


def _read_kept(kept: Path, whose: str) -> tuple[str, _Names] | None:
    """What was found in a file before; None where it was another file's content, or nothing whole is kept."""
    try:
        found = json.loads(kept.read_bytes())
        return (found["code"], found["imports"]) if found["whose"] == whose else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _keep(kept: Path, whose: str, code: str, imports: _Names) -> None:
    """Keep what was found in a file, where that can be written, in one step for whoever reads it now."""
    part = kept.with_suffix(f".{os.getpid()}.part")
    with contextlib.suppress(OSError):
        kept.parent.mkdir(exist_ok=True)
        part.write_text(json.dumps({"whose": whose, "code": code, "imports": imports}), encoding="utf-8")
        part.replace(kept)


def _names_imported(tree: ast.Module) -> _Names:
    found: _Names = []
    for node in _statements(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, []) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append((node.module, [alias.name for alias in node.names]))
    return [(module, names) for module, names in found if module.split(".")[0] == _PACKAGE.name]


def _imports(imported: _Names) -> tuple[str, ...]:
    """The modules among what is imported: which names are modules is seen in the folder, as it is now."""
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

"""Benchmarks run too seldom to notice what moved away under them: every name that they import of ours is there."""

import ast
import importlib
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
BENCHMARKS = sorted(FOLDER.rglob("*.py"))


def imported(path):
    """Module and name of each `from module import name` of a file; modules of benchmarks/ by their path in it."""
    package = path.relative_to(FOLDER).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            module = ".".join((*package, node.module)) if node.level else node.module
            yield from ((module, alias.name) for alias in node.names)


def defined(path):
    """Names that a file's top level defines."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        for target in getattr(node, "targets", [getattr(node, "target", None)]):
            if target is not None:
                yield from (part.id for part in ast.walk(target) if isinstance(part, ast.Name))


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: ".".join(path.relative_to(FOLDER).with_suffix("").parts))
def test_every_imported_name_of_ours_is_there(path):
    beside = {".".join(one.relative_to(FOLDER).with_suffix("").parts): one for one in BENCHMARKS}
    for module, name in imported(path):
        if module in beside:
            assert name in set(defined(beside[module])), f"{module}.{name}"
        elif module.partition(".")[0] == "polarsim" and not hasattr(importlib.import_module(module), name):
            importlib.import_module(f"{module}.{name}")  # a module of its package

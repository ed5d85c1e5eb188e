"""Benchmarks import only existing names; they run too rarely to detect a renamed module."""

import ast
import importlib
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]


@pytest.mark.parametrize("path", sorted((CHECKOUT / "benchmarks").glob("*.py")), ids=lambda path: path.stem)
def test_every_imported_name_exists(path, monkeypatch):
    monkeypatch.syspath_prepend(CHECKOUT / "benchmarks")
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            beside = (CHECKOUT / "benchmarks" / f"{node.module}.py").exists()
            if beside or node.module.split(".")[0] in ("polarsim", "benchmarks", "tests"):
                module = importlib.import_module(node.module)
                for alias in node.names:
                    if not hasattr(module, alias.name):
                        importlib.import_module(f"{node.module}.{alias.name}")

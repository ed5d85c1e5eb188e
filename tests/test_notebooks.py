"""The notebooks of the manual run, and packages define the names that notebooks import."""

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import matplotlib as mpl
import nbformat
import pytest

CHECKOUT = Path(__file__).parent.parent
NOTEBOOKS = sorted((CHECKOUT / "docs/notebooks").glob("*.ipynb"))
OFFERING = ("annotate", "cameras", "formats", "geometry", "labels", "lint", "render", "report", "rocks", "scoring")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(mpl.rcParams, "backend", "agg")
    book = nbformat.read(path, as_version=4)
    nbformat.validate(book)
    cells = [cell for cell in book.cells if cell.cell_type == "code"]
    assert len(cells) > 4
    assert not any(cell.outputs for cell in cells)  # notebooks are stored without outputs
    names: dict = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        exec(compile(cell.source, f"{path.name}, cell {number}", "exec"), names)  # the traceback contains the cell
    mpl.pyplot.close("all")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("package", OFFERING)
def test_a_package_defines_exactly_its_public_names(package):
    module = import_module(f"polarsim.{package}")
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name).__name__ == name
    assert dir(module) == sorted(module.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        module.nonsense  # noqa: B018


def test_public_names_of_a_package_are_imported_lazily():
    show = "print('numpy' in sys.modules)"
    program = f"import sys, polarsim.render; {show}; polarsim.render.Scene; {show}"
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": str(CHECKOUT)}, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["False", "True"]

"""The notebooks of the manual run from top to bottom, and packages offer what they import."""

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
    assert not any(cell.outputs for cell in cells)  # what a reader's own call shows
    names: dict = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        exec(compile(cell.source, f"{path.name}, cell {number}", "exec"), names)  # a failure names its cell
    mpl.pyplot.close("all")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("package", OFFERING)
def test_a_package_offers_names_that_are_there_and_no_others(package):
    module = import_module(f"polarsim.{package}")
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name).__name__ == name
    assert dir(module) == sorted(module.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        module.nonsense  # noqa: B018


def test_what_a_package_offers_is_not_imported_before_it_is_asked_for():
    told = "print('numpy' in sys.modules)"
    asked = f"import sys, polarsim.render; {told}; polarsim.render.Scene; {told}"
    done = subprocess.run(
        [sys.executable, "-c", asked], env=os.environ | {"PYTHONPATH": str(CHECKOUT)}, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["False", "True"]

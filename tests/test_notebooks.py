"""The notebooks of the manual run and show their outputs, and packages define the names that notebooks import."""

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import matplotlib as mpl
import nbformat
import pandas as pd
import pytest

from polarsim.formats.tables import write_csv, write_parquet
from tests.explore.made_run import make_run

CHECKOUT = Path(__file__).parent.parent
NOTEBOOKS = sorted((CHECKOUT / "docs/notebooks").glob("*.ipynb"))
OFFERING = ("annotate", "cameras", "formats", "geometry", "labels", "lint", "render", "report", "rocks", "scoring")


MAX_BYTES = 400_000  # of a notebook with outputs


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """A folder with a small finished run."""
    folder = tmp_path_factory.mktemp("checkout")
    run = make_run(folder / "results", "demo")
    pairs = pd.DataFrame([{"kind": kind, "iou_best": value} for kind in ("rock", "shadow") for value in (0.4, 0.9)])
    write_parquet(run / "evaluation/label_pairs_Terrain03.parquet", pairs)
    ipd = {"kind": "rock", "trained": ["analog", "hapke"], "first": "analog", "second": "hapke", "ipd": 0.1}
    write_csv(run / "tables/ipd.csv", pd.DataFrame(ipd | {"ipd_low": 0.05, "ipd_high": 0.2}))
    return folder


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(path, checkout, tmp_path, monkeypatch):
    needs_run = path.stem == "run"
    monkeypatch.chdir(checkout if needs_run else tmp_path)
    monkeypatch.setitem(mpl.rcParams, "backend", "agg")
    book = nbformat.read(path, as_version=4)
    nbformat.validate(book)
    cells = [cell for cell in book.cells if cell.cell_type == "code"]
    assert len(cells) > 4
    names: dict = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        exec(compile(cell.source, f"{path.name}, cell {number}", "exec"), names)  # the traceback contains the cell
    mpl.pyplot.close("all")
    assert needs_run or not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_with_the_outputs_of_all_cells(path):
    assert path.stat().st_size < MAX_BYTES
    cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))  # executed once, in order
    for cell in cells:
        kinds = {kind for output in cell.outputs for kind in output.get("data", {"text/plain": ""})}
        assert ("image/png" in kinds) == ("figure" in cell.source)
        assert not any(output.output_type == "error" for output in cell.outputs)


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

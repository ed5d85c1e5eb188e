"""Columns are declared once: pages list them, and writers write them."""

import re
from pathlib import Path

import pytest

from polarsim.acquire.index import photo_table
from polarsim.detect.predict import prediction_table
from polarsim.formats.tables import label_table
from polarsim.rocks.table import rock_table
from polarsim.schemas.__main__ import REPORT_TABLES, STAGE_TABLES, filled_page
from polarsim.schemas.detect import PREDICTIONS
from polarsim.schemas.photos import LABELS, PHOTOS
from polarsim.schemas.stages import ROCKS
from polarsim.schemas.table import Shared

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize("name", ["tables.md", "formats.md"])
def test_a_page_has_the_columns_of_the_code(name):
    page = (DOCS / name).read_text(encoding="utf-8")
    assert filled_page(page) == page, "run: make columns"


def test_every_table_of_the_report_is_on_its_page():
    page = (DOCS / "tables.md").read_text(encoding="utf-8")
    assert [table.path for table in REPORT_TABLES if f"<!-- columns of {table.path} -->" not in page] == []


def test_every_file_of_a_stage_is_in_the_list_of_files():
    files = (DOCS / "formats.md").read_text(encoding="utf-8").partition("## Columns of tables")[0]
    assert [table.path for table in STAGE_TABLES if f"{table.path.rpartition('/')[2]}`" not in files] == []


def test_each_table_is_declared_once_and_has_each_column_once():
    paths = [table.path for table in (*REPORT_TABLES, *STAGE_TABLES)]
    assert len(set(paths)) == len(paths)
    with pytest.raises(ValueError, match=r"a\.csv"):
        Shared("kind | str | | Kind").table("a.csv: A row\nkey kind | str | | Names\n= kind")


@pytest.mark.parametrize(
    "line",
    [
        "width | int | px | Width",
        "width | Interval | px | Width",
        "width | | px | Width",
        "width | int64 | Width",
        "width | int64 | px | Width | height",
        "| int64 | px | Width",
        "= kinds",
        "=kind",
        "kind",
    ],
)
def test_a_line_that_declares_no_columns_is_refused(line):
    shared = Shared("kind | str | | Kind")
    with pytest.raises(ValueError, match=re.escape(repr(line))):
        shared.table(f"a.csv: A row\n= kind\n{line}")
    with pytest.raises(ValueError, match=re.escape(repr(line))):
        Shared(line, shared)


def test_a_table_without_the_meaning_of_a_row_is_refused():
    with pytest.raises(ValueError, match=r"a\.csv"):
        Shared("kind | str | | Kind").table("a.csv\nkind | str | | Kind")


@pytest.mark.parametrize(
    ("made", "schema"),
    [(photo_table, PHOTOS), (label_table, LABELS), (rock_table, ROCKS), (prediction_table, PREDICTIONS)],
)
def test_a_table_without_rows_has_its_types(made, schema):
    types = {name: "int64" if kind == "terrain" else kind for name, kind in schema.dtypes.items()}
    assert {name: str(kind) for name, kind in made([]).dtypes.items()} == types

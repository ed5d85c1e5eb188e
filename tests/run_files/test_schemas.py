"""The document of formats names the columns that tables have, and tables have those."""

from pathlib import Path

import pytest

from polarsim.acquire.index import photo_table
from polarsim.detect.predict import prediction_table
from polarsim.formats.tables import label_table
from polarsim.rocks.table import rock_table
from polarsim.schemas import LABELS, PHOTOS, PREDICTIONS, ROCKS, SCHEMAS, markdown

DOCUMENT = Path(__file__).parents[2] / "docs/formats.md"


def test_the_document_ends_with_the_columns_of_all_tables():
    text = DOCUMENT.read_text(encoding="utf-8")
    assert text.endswith(markdown()), "docs/formats.md does not end with polarsim.schemas.markdown()"


def test_every_table_has_a_row_in_the_document():
    rows = DOCUMENT.read_text(encoding="utf-8").partition("## Columns of tables")[0]
    for schema in SCHEMAS:
        name = schema.path.rpartition("/")[2]
        assert f"{name}`" in rows, schema.path


def test_no_column_is_named_twice_and_every_unit_is_a_columns():
    for schema in SCHEMAS:
        assert set(schema.units) <= set(schema.columns), schema.path
    assert len({schema.path for schema in SCHEMAS}) == len(SCHEMAS)


@pytest.mark.parametrize(
    ("made", "schema"),
    [(photo_table, PHOTOS), (label_table, LABELS), (rock_table, ROCKS), (prediction_table, PREDICTIONS)],
)
def test_a_table_without_rows_has_its_types(made, schema):
    assert {name: str(kind) for name, kind in made([]).dtypes.items()} == schema.dtypes

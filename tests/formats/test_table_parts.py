import gc
import weakref

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.formats import tables
from polarsim.formats.table_parts import write_in_parts
from polarsim.provenance import digest

ITEMS = [f"{n:04d}" for n in range(23)]


def rows_of(items):
    """Return a table in which the last digit of an item is the number of rows."""
    rows = [(item, n / 3) for item in items for n in range(int(item[-1]))]
    table = pd.DataFrame(rows, columns=["key", "value"])
    return table.astype({"key": "str", "value": "float64"})


@settings(deadline=None, max_examples=8)
@given(size=st.integers(1, 30))
def test_the_table_does_not_depend_on_the_size_of_parts(tmp_path_factory, size):
    path = tmp_path_factory.mktemp("parts") / "table.parquet"
    write_in_parts(path, ITEMS, rows_of, size, "x")
    pd.testing.assert_frame_equal(tables.read_parquet(path), rows_of(ITEMS))
    assert [file.name for file in path.parent.iterdir()] == ["table.parquet"]


def test_interrupted_work_resumes_after_the_last_part(tmp_path):
    starts = []

    def stopping(items):
        starts.append(items[0])
        if len(starts) == 3:
            raise KeyboardInterrupt
        return rows_of(items)

    for _ in range(2):
        try:
            write_in_parts(tmp_path / "table.parquet", ITEMS, stopping, 10, "x")
        except KeyboardInterrupt:
            assert not (tmp_path / "table.parquet").exists()
    assert starts == ["0000", "0010", "0020", "0020"]
    pd.testing.assert_frame_equal(tables.read_parquet(tmp_path / "table.parquet"), rows_of(ITEMS))


def test_parts_with_another_identity_are_deleted(tmp_path):
    def stop(items):
        if items[0] == "0020":
            raise KeyboardInterrupt
        return rows_of(items).assign(value=9.0)

    with pytest.raises(KeyboardInterrupt):
        write_in_parts(tmp_path / "table.parquet", ITEMS, stop, 10, "of other weights")
    write_in_parts(tmp_path / "table.parquet", ITEMS, rows_of, 10, "x")
    pd.testing.assert_frame_equal(tables.read_parquet(tmp_path / "table.parquet"), rows_of(ITEMS))


def test_at_most_a_single_part_is_in_memory(tmp_path):
    tables_of_parts: list[weakref.ref] = []

    def recorded(items):
        gc.collect(0)  # a full collection takes seconds in a large test process
        assert not [table for table in tables_of_parts if table() is not None]
        table = rows_of(items)
        tables_of_parts.append(weakref.ref(table))
        return table

    write_in_parts(tmp_path / "table.parquet", ITEMS, recorded, 4, "x")
    assert len(tables_of_parts) == 6


def test_a_digest_depends_on_contents_names_and_texts(tmp_path):
    for name, text in (("a", "1"), ("b", "1"), ("c", "2")):
        (tmp_path / name).write_text(text)
    a, b, c = (tmp_path / name for name in "abc")
    assert len({digest([a]), digest([b]), digest([c]), digest([a, b]), digest([a], "x")}) == 5

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
    """An item has as many rows as its last digit says."""
    rows = [(item, n / 3) for item in items for n in range(int(item[-1]))]
    table = pd.DataFrame(rows, columns=["key", "value"])
    return table.astype({"key": "str", "value": "float64"})


@settings(deadline=None)
@given(size=st.integers(1, 30))
def test_the_table_is_the_same_whatever_the_size_of_its_parts(tmp_path_factory, size):
    path = tmp_path_factory.mktemp("parts") / "table.parquet"
    write_in_parts(path, ITEMS, rows_of, size, "x")
    pd.testing.assert_frame_equal(tables.read_parquet(path), rows_of(ITEMS))
    assert [file.name for file in path.parent.iterdir()] == ["table.parquet"]


def test_work_that_was_stopped_goes_on_after_its_last_part(tmp_path):
    asked = []

    def stopping(items):
        asked.append(items[0])
        if len(asked) == 3:
            raise KeyboardInterrupt
        return rows_of(items)

    for _ in range(2):
        try:
            write_in_parts(tmp_path / "table.parquet", ITEMS, stopping, 10, "x")
        except KeyboardInterrupt:
            assert not (tmp_path / "table.parquet").exists()
    assert asked == ["0000", "0010", "0020", "0020"]
    pd.testing.assert_frame_equal(tables.read_parquet(tmp_path / "table.parquet"), rows_of(ITEMS))


def test_parts_of_other_work_are_thrown_away(tmp_path):
    def stop(items):
        if items[0] == "0020":
            raise KeyboardInterrupt
        return rows_of(items).assign(value=9.0)

    with pytest.raises(KeyboardInterrupt):
        write_in_parts(tmp_path / "table.parquet", ITEMS, stop, 10, "of other weights")
    write_in_parts(tmp_path / "table.parquet", ITEMS, rows_of, 10, "x")
    pd.testing.assert_frame_equal(tables.read_parquet(tmp_path / "table.parquet"), rows_of(ITEMS))


def test_the_rows_of_one_part_at_most_are_held(tmp_path):
    alive: list[weakref.ref] = []

    def remembered(items):
        gc.collect()
        assert not [one for one in alive if one() is not None]
        table = rows_of(items)
        alive.append(weakref.ref(table))
        return table

    write_in_parts(tmp_path / "table.parquet", ITEMS, remembered, 4, "x")
    assert len(alive) == 6


def test_a_digest_tells_contents_names_and_words_apart(tmp_path):
    for name, text in (("a", "1"), ("b", "1"), ("c", "2")):
        (tmp_path / name).write_text(text)
    a, b, c = (tmp_path / name for name in "abc")
    assert len({digest([a]), digest([b]), digest([c]), digest([a, b]), digest([a], "x")}) == 5

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect.grouping import rows_by, values_by

ROWS = st.lists(st.tuples(st.sampled_from("abcd"), st.sampled_from("xy"), st.integers(0, 9)), max_size=30)


@settings(max_examples=10)
@given(ROWS)
def test_groups_agree_with_pandas(rows):
    table = pd.DataFrame(rows, columns=["key", "kind", "value"])
    expected = {name: part["value"].tolist() for name, part in table.groupby(["key", "kind"])}
    found = values_by(table, ["key", "kind"], ["value"])
    assert {name: values[:, 0].tolist() for name, values in found.items()} == expected
    alone = {name: part["value"].tolist() for name, part in table.groupby("key")}
    assert {name: values[:, 0].tolist() for name, values in values_by(table, ["key"], ["value"]).items()} == alone


def test_rows_are_numbered_by_their_position_whatever_their_index():
    table = pd.DataFrame({"key": ["b", "a", "b"]}, index=[7, 7, 9])
    found = rows_by(table, ["key"])
    assert list(found) == ["a", "b"]
    np.testing.assert_array_equal(found["b"], [0, 2])

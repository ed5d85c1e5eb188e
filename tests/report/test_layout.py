from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import ConfigError
from polarsim.formats.tables import read_csv, read_parquet
from polarsim.report import layout

TABLE = pd.DataFrame({"name": ["a_b", "c|d"], "n": [3, 12], "f1": [0.5, np.nan], "good": [True, False]})


def test_csv_and_parquet_contain_the_same_rows(tmp_path):
    layout.write_table(tmp_path / "some.table", TABLE, "A caption")
    pd.testing.assert_frame_equal(read_parquet(tmp_path / "some.table.parquet"), TABLE, check_dtype=False)
    pd.testing.assert_frame_equal(read_csv(tmp_path / "some.table.csv"), TABLE, check_dtype=False)
    assert {path.name for path in tmp_path.iterdir()} == {
        f"some.table.{form}" for form in ("csv", "parquet", "md", "tex")
    }


def test_markdown_escapes_column_separators_and_emphasis():
    lines = layout.markdown(TABLE, "50 % of *all*").splitlines()
    assert lines == [
        r"**50 % of \*all\***",
        "",
        "| name | n | f1 | good |",
        "| --- | ---: | ---: | --- |",
        r"| a\_b | 3 | 0.500 | yes |",
        r"| c\|d | 12 | – | no |",
    ]


def test_latex_is_a_table_of_booktabs_with_escaped_text_and_aligned_numbers():
    text = layout.latex(TABLE, "50 % of all", ["a & b"], label="t")
    assert r"\begin{tabular}{lrrl}" in text
    assert r"a\_b & 3 & 0.500 & yes \\" in text
    assert r"\caption{50 \% of all}" in text
    assert r"a \& b" in text
    lines = text.splitlines()
    assert lines[0] == r"% Needs \usepackage{booktabs}."
    assert [line for line in lines if line.endswith("rule")] == [r"\toprule", r"\midrule", r"\bottomrule"]
    assert lines.index(r"\toprule") + 2 == lines.index(r"\midrule")  # the header between them


@given(st.text(alphabet=st.characters(codec="ascii", exclude_categories=["Cc"])))
def test_latex_text_escapes_every_special_character(text):
    shown = layout.tex_text(text)
    for made in (*layout._TEX.values(), "$<$", "$>$"):
        shown = shown.replace(made, "")
    assert not set(shown) & set("&%$#_{}~^\\<>")


@pytest.mark.parametrize(
    ("value", "column", "text"),
    [
        (3, "n", "3"),
        (np.int64(3), "n", "3"),
        (0.98765, "map50", "0.988"),
        (1.23456, "error_mm", "1.23"),
        (12345.6, "vertices", "12346"),
        (60.0, "count", "60"),
        (256.0, "exposure_ms", "256"),
        (float("nan"), "f1", "–"),
        (None, "f1", "–"),
        (np.True_, "shares_views", "yes"),
        ("photo", "split", "photo"),
    ],
)
def test_the_format_of_a_cell_depends_on_type_and_column(value, column, text):
    assert layout.format_value(value, column) == text


def test_blocks_are_written_in_order_with_the_notes_at_the_end(tmp_path):
    layout.write_blocks(tmp_path / "t", TABLE, {"One.": TABLE[["name"]], "Two.": TABLE[["n"]]}, ["A note."])
    lines = (tmp_path / "t.md").read_text().splitlines()
    assert [line for line in lines if line and not line.startswith("|")] == ["**One.**", "**Two.**", "A note."]
    tex = (tmp_path / "t.tex").read_text()
    assert tex.index(r"\label{tab:t}") < tex.index(r"\label{tab:t-2}") < tex.index("A note.")
    assert tex.count(r"\end{table}") == 2
    assert len(read_csv(tmp_path / "t.csv")) == len(TABLE)


def test_the_columns_of_the_origin_are_first_and_must_be_complete():
    table = layout.with_origin(TABLE, {"run": "demo", "source": "analog", "config": "1a2b"})
    assert list(table.columns[:3]) == ["run", "source", "config"]
    assert set(table["source"]) == {"analog"}
    with pytest.raises(ConfigError, match="config"):
        layout.with_origin(TABLE, {"run": "demo", "source": "analog"})
    with pytest.raises(ConfigError, match="run"):
        layout.write_table(Path("unwritten"), TABLE, "Caption", origin={})

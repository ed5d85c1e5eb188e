"""Writers of report tables: CSV and Parquet contain the tidy rows, Markdown and LaTeX a formatted extract."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.errors import ConfigError
from polarsim.formats.files import write_text
from polarsim.formats.tables import write_csv, write_parquet

ORIGIN_COLUMNS = ("run", "source", "config")  # name of the run, kind of its source, hash of its configuration
ORIGIN_NOTE = "Run {run}, source {source}, configuration {config}."
MISSING = "–"  # a cell without a value

# Decimals by the suffix of the column name; three for all other columns.
_DECIMALS = {"_mm": 2, "_px": 2, "_deg": 3, "exposure_ms": 0, "count": 0}
_TEX = {
    **{character: "\\" + character for character in "&%$#_{}"},
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "<": r"$<$",
    ">": r"$>$", "≥": r"$\geq$", "±": r"$\pm$", "°": r"$^\circ$",
}  # fmt: skip


def with_origin(table: pd.DataFrame, origin: Mapping[str, str]) -> pd.DataFrame:
    """Return the table with the columns of its origin first, so that tables of several runs can be concatenated."""
    missing = [name for name in ORIGIN_COLUMNS if name not in origin]
    if missing:
        raise ConfigError(f"origin without {missing[0]!r}, expected {', '.join(ORIGIN_COLUMNS)}")
    columns = {name: pd.Series([str(origin[name])] * len(table), dtype="str") for name in ORIGIN_COLUMNS}
    return pd.concat([pd.DataFrame(columns), table.reset_index(drop=True)], axis=1)


def write_table(
    stem: Path,
    table: pd.DataFrame,
    caption: str,
    *,
    layout: pd.DataFrame | None = None,
    notes: Sequence[str] = (),
    origin: Mapping[str, str] | None = None,
) -> None:
    """Write stem.csv, stem.parquet, stem.md and stem.tex.

    CSV (six digits) and Parquet (all digits) contain `table`, Markdown and LaTeX contain `layout` (default: the same
    rows) and the notes below.
    """
    write_blocks(stem, table, {caption: table if layout is None else layout}, notes, origin)


def write_blocks(
    stem: Path,
    table: pd.DataFrame,
    blocks: Mapping[str, pd.DataFrame],
    notes: Sequence[str] = (),
    origin: Mapping[str, str] | None = None,
) -> None:
    """Write the four files of `write_table`; Markdown and LaTeX contain several tables by caption, then the notes.

    With an `origin`, the first columns and the last note name the run, the source and the configuration.
    """
    if origin is not None:
        table, notes = with_origin(table, origin), [*notes, ORIGIN_NOTE.format(**origin)]
    write_parquet(_form(stem, ".parquet"), table)  # first, because it needs an extra
    write_csv(_form(stem, ".csv"), table)
    notes_of = dict.fromkeys(blocks, ()) | dict.fromkeys(list(blocks)[-1:], tuple(notes))
    shown = [markdown(block, caption, notes_of[caption]) for caption, block in blocks.items()]
    write_text(_form(stem, ".md"), "\n".join(shown))
    shown = [
        latex(block, caption, notes_of[caption], label=stem.name if number == 1 else f"{stem.name}-{number}")
        for number, (caption, block) in enumerate(blocks.items(), 1)
    ]
    write_text(_form(stem, ".tex"), "\n".join(shown))


def grid(rows: pd.DataFrame, side: str, text: Sequence[str]) -> pd.DataFrame:
    """Pivot the texts of rows: a row per value of column `side`, a column per value of `value`, order kept."""
    sides, values = (list(dict.fromkeys(rows[name])) for name in (side, "value"))
    shown = rows.assign(text=text).pivot_table("text", side, "value", aggfunc="first")
    return shown.reindex(index=sides, columns=values).fillna(MISSING).rename_axis(columns=None).reset_index()


def markdown(table: pd.DataFrame, caption: str, notes: Sequence[str] = ()) -> str:
    """Return the table in Markdown with numbers aligned right."""
    rows = [[_markdown_text(cell) for cell in row] for row in cells(table)]
    header = [_markdown_text(str(name)) for name in table.columns]
    rule = ["---:" if _is_number(table[name]) else "---" for name in table.columns]
    lines = [f"**{_markdown_text(caption)}**", ""]
    lines += ["| " + " | ".join(row) + " |" for row in [header, rule, *rows]]
    for note in notes:
        lines += ["", _markdown_text(note)]
    return "\n".join(lines) + "\n"


def latex(table: pd.DataFrame, caption: str, notes: Sequence[str] = (), label: str = "") -> str:
    """Return the table in LaTeX; requires the package booktabs."""
    header = [f"\\textbf{{{tex_text(str(name))}}}" for name in table.columns]
    rows = [[tex_text(cell) for cell in row] for row in cells(table)]
    lines = ["% Needs \\usepackage{booktabs}.", "\\begin{table}", "\\centering", f"\\caption{{{tex_text(caption)}}}"]
    lines += [f"\\label{{tab:{label}}}"] if label else []
    lines += ["\\begin{tabular}{" + "".join("r" if _is_number(table[name]) else "l" for name in table.columns) + "}"]
    lines += ["\\toprule", " & ".join(header) + r" \\", "\\midrule", *(" & ".join(row) + r" \\" for row in rows)]
    lines += [
        "\\bottomrule",
        "\\end{tabular}",
        *(f"\\par\\smallskip {tex_text(note)}" for note in notes),
        "\\end{table}",
    ]
    return "\n".join(lines) + "\n"


def cells(table: pd.DataFrame) -> list[list[str]]:
    """Return the formatted text of every cell, row by row."""
    columns = [[format_value(value, str(name)) for value in table[name]] for name in table.columns]
    return [list(row) for row in zip(*columns, strict=True)]


def format_value(value: object, column: str = "") -> str:
    """Return the text of a cell: floats with the decimals of the column, `MISSING` for no value."""
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return MISSING
    if hasattr(value, "item"):  # NumPy scalar to Python scalar
        value = value.item()
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        decimals = next((number for unit, number in _DECIMALS.items() if column.endswith(unit)), 3)
        return f"{value:.{decimals}f}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value)


def value_and_interval(value: float, low: float, high: float, form: str = ".3f") -> str:
    """Return a value as text in a format, with the interval if there is one."""
    if math.isnan(value):
        return MISSING
    interval = "" if math.isnan(low) or math.isnan(high) else f" [{low:{form}}, {high:{form}}]"
    return f"{value:{form}}{interval}"


def interval_text(row: Mapping[Any, Any] | pd.Series, name: str, decimals: int = 3, sign: str = "") -> str:
    """Return a metric of a row as text, with the interval from `<name>_low` to `<name>_high` if there is one.

    `sign`: "+" shows the sign of positive values.
    """
    value, low, high = (float(row[f"{name}{end}"]) for end in ("", "_low", "_high"))
    return value_and_interval(value, low, high, f"{sign}.{decimals}f")


def tex_text(text: str) -> str:
    """Return the text with LaTeX's special characters escaped."""
    return "".join(_TEX.get(character, character) for character in text)


def _markdown_text(text: str) -> str:
    """Return the text with Markdown's column separators and emphasis escaped."""
    return re.sub(r"([|*_\\`<])", r"\\\1", text.replace("\n", " "))


def _is_number(column: pd.Series) -> bool:
    return pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)


def _form(stem: Path, suffix: str) -> Path:
    return stem.with_name(stem.name + suffix)

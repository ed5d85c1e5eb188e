"""Declaration of the columns of tables by text.

A line `names | type | unit | description` declares columns of the same type, unit and description; further lines of a
description are indented. The type `interval` declares a metric and the bounds of the 95 % interval: `name`, `name_low`,
`name_high`. The type `terrain` is int64 if the terrains of the site are numbers, and str if they are names. A line
`= name name` refers to shared columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import dedent
from typing import Literal, cast, get_args

Dtype = Literal["str", "int64", "float64", "bool", "terrain"]


@dataclass(frozen=True)
class Columns:
    """Columns with the same type, unit (`1` for shares and ratios, empty for text and identifiers) and description."""

    names: str  # separated by blanks
    dtype: Dtype  # name of the type in pandas, or `terrain`: int64 for numbers, str for names
    unit: str
    description: str  # Markdown without a full stop at the end

    @property
    def each(self) -> tuple[str, ...]:
        return tuple(self.names.split())

    @property
    def shown_type(self) -> str:
        return "int64 or str" if self.dtype == "terrain" else self.dtype


class Table:
    """Table of a run: path below the folder of the run, meaning of a row, and columns in order."""

    def __init__(self, path: str, row: str, declared: tuple[Columns, ...]) -> None:
        self.path = path  # `TT` is the number of a terrain; no suffix: four files, .csv, .md, .tex and .parquet
        self.row = row  # meaning of a row as a noun phrase: "A photo"
        self.declared = declared
        self.dtypes: dict[str, Dtype] = {name: group.dtype for group in declared for name in group.each}
        if len(self.dtypes) != sum(len(group.each) for group in declared):
            raise ValueError(f"{path}: a column is declared twice")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.dtypes)

    def without(self, *names: str) -> tuple[str, ...]:
        """Return the names of the columns in order, except the given names."""
        return tuple(name for name in self.columns if name not in names)

    def markdown(self) -> str:
        """Return the columns as a table in Markdown."""
        rows = [
            f"| {', '.join(f'`{name}`' for name in part.each)} | {part.shown_type} | {part.unit} | {part.description} |"
            for part in self.declared
        ]
        return "\n".join(["| column | type | unit | description |", "|---|---|---|---|", *rows])


class Shared:
    """Columns of several tables by name; a line `name: ...` adds to a name, by default that of the first column."""

    def __init__(self, text: str, *others: Shared) -> None:
        self._columns: dict[str, tuple[Columns, ...]] = {}
        for other in others:
            self._columns |= other._columns
        own: dict[str, tuple[Columns, ...]] = {}
        for line in _lines(text):
            name, row = line.split(": ", 1) if re.match(r"\w+: ", line) else ("", line)
            columns = self._declared(row)
            name = name or columns[0].each[0]
            own[name] = (*own.get(name, ()), *columns)
            self._columns[name] = own[name]

    def __getitem__(self, name: str) -> tuple[Columns, ...]:
        return self._columns[name]

    def table(self, text: str) -> Table:
        """Return a table from a line `path: meaning of a row` and lines of columns."""
        head, *lines = _lines(text)
        path, _, row = head.partition(": ")
        if not row:
            raise ValueError(f"{head!r}: expected `path: meaning of a row`")
        return Table(path, row, tuple(columns for line in lines for columns in self._declared(line)))

    def _declared(self, line: str) -> tuple[Columns, ...]:
        if line.startswith("= "):
            shared = line.split()[1:]
            if unknown := [name for name in shared if name not in self._columns]:
                raise ValueError(f"{line!r}: {unknown[0]!r} is not shared, expected some of {', '.join(self._columns)}")
            return tuple(columns for name in shared for columns in self._columns[name])
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) != 4 or not cells[0]:
            raise ValueError(f"{line!r}: expected `names | type | unit | description` or `= name name`")
        names, dtype, unit, description = cells
        if dtype not in (*get_args(Dtype), "interval"):
            raise ValueError(f"{line!r}: type {dtype!r}, expected {', '.join(get_args(Dtype))} or interval")
        if dtype == "interval":
            names, dtype = f"{names} {names}_low {names}_high", "float64"
            description = f"{description} (with 95 % interval)"
        return (Columns(names, cast(Dtype, dtype), unit, description),)


def _lines(text: str) -> Iterator[str]:
    """Yield the lines of a text, each joined with the following indented lines."""
    for line in re.split(r"\n(?! )", dedent(text).strip()):
        yield re.sub(r"\s*\n\s*", " ", line)

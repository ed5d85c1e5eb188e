"""Declaration of the columns of a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Dtype = Literal["str", "int64", "float64", "bool"]
TEXT: Dtype = "str"
INTEGER: Dtype = "int64"
NUMBER: Dtype = "float64"
BOOL: Dtype = "bool"


@dataclass(frozen=True)
class Columns:
    """Columns with the same type, unit and description.

    Attributes
    ----------
    names
        Names of the columns, separated by blanks.
    dtype
        Name of the type in pandas.
    unit
        Unit of the values, such as `px` or `mm`; `1` for shares and ratios; empty for text, identifiers and booleans.
    description
        Content of the columns: Markdown without a full stop at the end.
    """

    names: str
    dtype: Dtype
    unit: str
    description: str

    @property
    def each(self) -> tuple[str, ...]:
        return tuple(self.names.split())


class Table:
    """Table of a run: path below the folder of the run, meaning of a row, and columns in order."""

    def __init__(self, path: str, row: str, *columns: Columns | tuple[Columns, ...]) -> None:
        self.path = path  # `TT` is the number of a terrain; no suffix: four files, .csv, .md, .tex and .parquet
        self.row = row  # meaning of a row as a noun phrase: "A photo"
        self.declared = tuple(group for part in columns for group in (part if isinstance(part, tuple) else (part,)))
        self.dtypes: dict[str, Dtype] = {name: group.dtype for group in self.declared for name in group.each}
        if len(self.dtypes) != sum(len(group.each) for group in self.declared):
            raise ValueError(f"{path}: a column is declared twice")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.dtypes)

    @property
    def units(self) -> dict[str, str]:
        """Units of the columns with a unit."""
        return {name: group.unit for group in self.declared for name in group.each if group.unit}

    def without(self, *names: str) -> tuple[str, ...]:
        """Return the names of the columns in order, except the given names."""
        return tuple(name for name in self.columns if name not in names)

    def markdown(self) -> str:
        """Return the columns as a table in Markdown."""
        rows = [
            f"| {', '.join(f'`{name}`' for name in group.each)} | {group.dtype} | {group.unit} | {group.description} |"
            for group in self.declared
        ]
        return "\n".join(["| column | type | unit | description |", "|---|---|---|---|", *rows])


def interval_columns(name: str, unit: str, description: str) -> Columns:
    """Return a metric and the bounds of the 95 % interval: `name`, `name_low`, `name_high`."""
    return Columns(f"{name} {name}_low {name}_high", NUMBER, unit, f"{description} (with 95 % interval)")

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
    """One or several columns with the same type, unit and description.

    Attributes
    ----------
    names
        Names of the columns, separated by blanks.
    dtype
        Type as pandas names it.
    unit
        Unit of the values, such as `px` or `mm`; `1` for shares and ratios; empty for text, identifiers and truth
        values.
    description
        Content of the columns, in a sentence of Markdown without its full stop.
    """

    names: str
    dtype: Dtype
    unit: str
    description: str

    @property
    def each(self) -> tuple[str, ...]:
        return tuple(self.names.split())


class Table:
    """A table of a run: its path below the run's folder, what a row is, and its columns in order."""

    def __init__(self, path: str, row: str, *columns: Columns | tuple[Columns, ...]) -> None:
        self.path = path  # `TT` stands for a terrain; without a suffix: four files, .csv, .md, .tex and .parquet
        self.row = row  # what a row is, in a noun phrase: "A photo"
        self.declared = tuple(one for part in columns for one in (part if isinstance(part, tuple) else (part,)))
        self.dtypes: dict[str, Dtype] = {name: one.dtype for one in self.declared for name in one.each}
        if len(self.dtypes) != sum(len(one.each) for one in self.declared):
            raise ValueError(f"{path}: a column is declared twice")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(self.dtypes)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column that has one."""
        return {name: one.unit for one in self.declared for name in one.each if one.unit}

    def without(self, *names: str) -> tuple[str, ...]:
        """Return the names of the columns but some, in order."""
        return tuple(name for name in self.columns if name not in names)

    def markdown(self) -> str:
        """Return the columns as a table in Markdown."""
        rows = [
            f"| {', '.join(f'`{name}`' for name in one.each)} | {one.dtype} | {one.unit} | {one.description} |"
            for one in self.declared
        ]
        return "\n".join(["| column | type | unit | meaning |", "|---|---|---|---|", *rows])


def with_interval(name: str, unit: str, description: str) -> Columns:
    """Return a metric and the bounds of its 95 % interval: `name`, `name_low`, `name_high`."""
    return Columns(f"{name} {name}_low {name}_high", NUMBER, unit, f"{description}, and its 95 % interval")

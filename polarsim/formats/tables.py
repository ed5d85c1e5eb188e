"""Tables as Parquet and CSV files. Equal rows make equal bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import infer_dtype

from polarsim.errors import FormatError
from polarsim.formats.files import text_of, write_json, writing
from polarsim.formats.readers import reader
from polarsim.photo import PhotoKey
from polarsim.schemas.photos import LABELS, PHOTOS
from polarsim.schemas.table import Dtype, Table

PHOTO_COLUMNS, LABEL_COLUMNS = PHOTOS.columns, LABELS.columns
_TEXTS = ("key", "position", "light", "azimuth", "terrain")  # columns of names, which may consist of digits


def typed(rows: Sequence[Any] | pd.DataFrame, schema: Table, *, without: Sequence[str] = ()) -> pd.DataFrame:
    """Return rows as a table with the columns of a declared table and their types. It may be empty.

    `without`: columns that the table does not have yet.
    """
    columns = schema.without(*without)
    table = pd.DataFrame(rows, columns=list(columns))
    return table.astype({name: _pandas_type(schema.dtypes[name], table[name]) for name in columns})


def _pandas_type(declared: Dtype, values: pd.Series) -> str:
    """Return the type of a column in pandas. An empty column of terrains has the type of numbers."""
    if declared != "terrain":
        return declared
    return "int64" if infer_dtype(values) in ("integer", "empty") else "str"


def write_parquet(path: str | Path, table: pd.DataFrame) -> None:
    """Write a table with a single row group, zstd and no pandas index: the bytes depend on the rows only."""
    import pyarrow  # noqa: F401  (the error names the extra; that of pandas does not)

    with writing(path) as temporary:
        table.to_parquet(temporary, index=False, compression="zstd")


@reader("Parquet table", largest_mb=4000)
def read_parquet(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table that must have `columns`."""
    import pyarrow as pa

    table = pd.read_parquet(path)
    texts: list[str] = list(table.select_dtypes("str").columns)
    for name in texts:
        pa.Array.from_pandas(table[name]).validate(full=True)  # invalid texts would raise later
    return _with_columns(table, columns, path)


def write_csv(path: str | Path, table: pd.DataFrame) -> None:
    with writing(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g", lineterminator="\n")


TABLE_SUFFIXES = (".csv", ".json", ".parquet")


def write_by_suffix(path: str | Path, table: pd.DataFrame) -> None:
    """Write a table as CSV, Parquet or JSON (a list of objects), by the extension of the file."""
    suffix = Path(path).suffix.lower()
    if suffix not in TABLE_SUFFIXES:
        raise FormatError(f"unknown extension {suffix!r}, expected {', '.join(TABLE_SUFFIXES)}", path=path)
    if suffix == ".json":
        write_json(path, table.astype(object).where(table.notna(), None).to_dict("records"))
    else:
        {".csv": write_csv, ".parquet": write_parquet}[suffix](path, table)


@reader("CSV table")
def read_csv(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table that must have `columns`. The parts of photo keys are text, and terrains int64 or text."""
    table = pd.read_csv(io.StringIO(text_of(path)), dtype=dict.fromkeys(_TEXTS, "str"))
    if "terrain" in table.columns and table["terrain"].str.isdecimal().all():
        table["terrain"] = table["terrain"].astype("int64")
    return _with_columns(table, columns, path)


def _with_columns(table: pd.DataFrame, columns: Sequence[str], path: str | Path) -> pd.DataFrame:
    """Return the table after a check that it has all columns."""
    for name in columns:
        if name not in table.columns:
            raise FormatError(f"column {name!r} is missing", path=path)
    return table


def key_columns(key: PhotoKey) -> dict[str, object]:
    """Return the seven columns that identify a photo."""
    return {
        "key": str(key),
        "terrain": key.terrain,
        "position": key.position,
        "light": key.light,
        "azimuth": key.azimuth,
        "camera": key.camera,
        "exposure_ms": key.exposure_ms,
    }


def label_table(rows: list[dict[str, object]] | pd.DataFrame) -> pd.DataFrame:
    """Return a table with `LABEL_COLUMNS` and their types, sorted by photo, kind, rock and box. It may be empty."""
    table = typed(rows, LABELS)
    return table.sort_values(["key", "kind", "rock", "x0", "y0"], kind="stable", ignore_index=True)


def merge_label_tables(*, tables: list[Path], merged: Path) -> None:
    """Merge the label tables of terrains into a table sorted by photo."""
    parts = [read_parquet(path, LABEL_COLUMNS) for path in tables]
    write_parquet(merged, label_table(pd.concat(parts)))

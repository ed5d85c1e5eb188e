"""Tables as Parquet and CSV, always the same bytes for the same rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from polarsim.errors import FormatError
from polarsim.formats.files import writing
from polarsim.formats.schemas import LABELS, PHOTOS
from polarsim.photo import PhotoKey

PHOTO_COLUMNS, LABEL_COLUMNS = PHOTOS.columns, LABELS.columns


def write_parquet(path: str | Path, table: pd.DataFrame) -> None:
    """One row group, no pandas index, zstd: the bytes depend on the rows alone."""
    with writing(path) as temporary:
        table.to_parquet(temporary, index=False, compression="zstd")


def read_parquet(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table that must have `columns`.

    Raises
    ------
    FormatError
        No readable Parquet file, or a column is missing.
    """
    try:
        table = pd.read_parquet(path)
    except Exception as error:  # pyarrow raises many kinds
        raise FormatError(f"no readable Parquet table, {str(error).splitlines()[0]}", path=path) from error
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise FormatError(f"column {missing[0]!r} is missing", path=path)
    return table


def write_csv(path: str | Path, table: pd.DataFrame) -> None:
    with writing(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g", lineterminator="\n")


def read_csv(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table that must have `columns`.

    Raises
    ------
    FormatError
        No readable CSV file, or a column is missing.
    """
    try:
        table = pd.read_csv(path, dtype={"azimuth": str, "light": str, "key": str})
    except Exception as error:
        raise FormatError(f"no readable CSV table, {str(error).splitlines()[0]}", path=path) from error
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise FormatError(f"column {missing[0]!r} is missing", path=path)
    return table


def key_columns(key: PhotoKey) -> dict[str, object]:
    """The seven columns that name a photo."""
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
    """Rows with `LABEL_COLUMNS`, typed and in the order of photo, kind, rock, place; also when there are none."""
    table = pd.DataFrame(rows, columns=list(LABEL_COLUMNS)).astype(LABELS.dtypes)
    return table.sort_values(["key", "kind", "rock", "x0", "y0"], kind="stable", ignore_index=True)


def merge_label_tables(*, tables: list[Path], merged: Path) -> None:
    """One table of all terrains, in the order of photos."""
    parts = [read_parquet(path, LABEL_COLUMNS) for path in tables]
    write_parquet(merged, label_table(pd.concat(parts)))

"""Long tables written in parts: memory is bounded by a part, and interrupted work resumes after the last part."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats import tables
from polarsim.formats.files import write_text, writing
from polarsim.progress import track


def write_in_parts(
    path: Path, items: Sequence[str], rows_of: Callable[[Sequence[str]], pd.DataFrame], size: int, identity: str
) -> None:
    """Write the rows of all items to a Parquet file with a row group per part.

    `rows_of` returns the table of some items in the given order, always with the same columns; `size` is the number of
    items per part. `identity` identifies everything that determines the rows; parts of an interrupted call with the
    same identity are reused.
    """
    folder = path.with_name(f".{path.stem}.parts")
    reuse_folder(folder, identity)
    parts = []
    for number, start in enumerate(track(range(0, len(items), size), path.stem)):
        part = folder / f"{number:05d}.parquet"
        if not part.is_file():
            tables.write_parquet(part, rows_of(items[start : start + size]))
        parts.append(part)
    _join(parts, path)
    shutil.rmtree(folder, ignore_errors=True)


def reuse_folder(folder: Path, identity: str) -> None:
    """Create a folder for resumable work. Delete the existing content unless it has the same identity."""
    note = folder / "identity.txt"
    if not note.is_file() or note.read_text(encoding="utf-8") != identity:
        shutil.rmtree(folder, ignore_errors=True)
        write_text(note, identity)


def _join(parts: Sequence[Path], path: Path) -> None:
    from pyarrow import parquet

    with (
        writing(path) as temporary,
        parquet.ParquetWriter(temporary, parquet.read_schema(parts[0]), compression="zstd") as writer,
    ):
        for part in parts:
            writer.write_table(parquet.read_table(part))

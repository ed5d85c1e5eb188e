"""Paths of the input and output files of a script: Snakemake passes a file as string and several files as list."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def list_of_paths(files: Iterable[str]) -> list[Path]:
    """Return the paths of a list of files, which may be empty."""
    if isinstance(files, str | Path):
        raise TypeError(f"{str(files)!r} is a single file, expected a list of files")
    return [Path(file) for file in files]


def optional_path(file: str | Iterable[str] | None) -> Path | None:
    """Return the path of an optional file; None for None and for an empty list."""
    if isinstance(file, str):
        return Path(file)
    if file is not None and list(file):
        raise TypeError(f"{list(file)} is a list of files, expected a single file or none")
    return None

"""Paths from the files that Snakemake gives to a script: a string for one file, a list where the rule has a list."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def paths(files: Iterable[str]) -> list[Path]:
    """Return the paths of a list of files, which may be empty.

    Raises
    ------
    TypeError
        One file instead of a list: its characters are no files.
    """
    if isinstance(files, str | Path):
        raise TypeError(f"{str(files)!r} is one file, expected a list of files")
    return [Path(file) for file in files]


def optional_path(file: str | Iterable[str] | None) -> Path | None:
    """Return the path of a file that a rule may lack; None for None and for an empty list.

    Raises
    ------
    TypeError
        A list of files.
    """
    if isinstance(file, str):
        return Path(file)
    if file is not None and list(file):
        raise TypeError(f"{list(file)} is a list of files, expected one file or none")
    return None

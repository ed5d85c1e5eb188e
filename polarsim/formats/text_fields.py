"""Text files of fields between spaces, a record a line, as YOLO's and KITTI's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.readers import reading


def fields_of(path: str | Path, what: str) -> list[tuple[int, list[str]]]:
    """Number and fields of every line that is not empty; `what` the file is meant to be, such as `label file`.

    Raises
    ------
    FormatError
        No readable file, or no ASCII.
    """
    with reading(what, path):
        text = Path(path).read_text(encoding="ascii")
    return [(n, line.split()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]


def numbers(path: str | Path, number: int, fields: Sequence[str]) -> np.ndarray:
    """(n,) values of fields of a line.

    Raises
    ------
    FormatError
        One is no finite number.
    """
    try:
        values = np.array([float(field) for field in fields])
    except ValueError as error:
        raise FormatError(str(error), path=path, line=number) from error
    if not np.isfinite(values).all():
        raise FormatError("a value that is not finite", path=path, line=number)
    return values

"""Text files of fields between blanks, one record per line, such as those of YOLO and KITTI."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import lines_of
from polarsim.formats.readers import reading


def fields_of(path: str | Path, what: str) -> list[tuple[int, list[str]]]:
    """Return number and fields of every line that is not empty; `what` names the kind of file, such as `label file`.

    Raises
    ------
    FormatError
        No readable file, or no text.
    """
    with reading(what, path):
        lines = lines_of(Path(path).read_bytes())
    return [(n, line.split()) for n, line in enumerate(lines, 1) if line.strip()]


def numbers(path: str | Path, number: int, fields: Sequence[str]) -> np.ndarray:
    """Return the (n,) values of the fields of a line.

    Raises
    ------
    FormatError
        A field is no finite number.
    """
    joined = "".join(fields)
    if "_" in joined or not joined.isascii():  # Python accepts `1_000` and digits of other scripts
        wrong = next(field for field in fields if "_" in field or not field.isascii())
        raise FormatError(f"could not convert string to float: {wrong!r}", path=path, line=number)
    try:
        values = np.array([float(field) for field in fields])
    except ValueError as error:
        raise FormatError(str(error), path=path, line=number) from error
    if not np.isfinite(values).all():
        raise FormatError("a value that is not finite", path=path, line=number)
    return values

"""Text files with a record per line and fields separated by blanks, such as YOLO label files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import lines_of
from polarsim.formats.readers import reading


def fields_of(path: str | Path, kind: str) -> list[tuple[int, list[str]]]:
    """Return number and fields of every line that is not empty; `kind` is the kind of file, such as `label file`."""
    with reading(kind, path):
        lines = lines_of(Path(path).read_bytes())
    return [(n, line.split()) for n, line in enumerate(lines, 1) if line.strip()]


def parse_values(path: str | Path, number: int, fields: Sequence[str]) -> np.ndarray:
    """Return the (n,) values of the fields of a line."""
    values = np.empty(len(fields))
    for n, field in enumerate(fields):
        try:
            if "_" in field or not field.isascii():  # Python accepts `1_000` and digits of other scripts
                raise ValueError
            values[n] = float(field)
        except ValueError as error:
            comma = ", write a decimal point" if "," in field else ""
            raise FormatError(f"{field!r} is not a number{comma}", path=path, line=number) from error
    if not np.isfinite(values).all():
        raise FormatError("a value is not finite", path=path, line=number)
    return values

"""NPZ files of named arrays. Equal arrays make equal bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import writing
from polarsim.formats.readers import reader


def write_arrays(path: Path, **arrays: np.ndarray | np.generic) -> None:
    with writing(path) as temporary:
        np.savez_compressed(temporary, **arrays)  # type: ignore[arg-type]  # the type stub treats the names as options


@reader("NPZ file", largest_mb=4000)
def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Read an NPZ file that must contain the arrays `names`."""
    with np.load(path, allow_pickle=False) as content:
        arrays = {name: content[name] for name in content.files}
    for name in names:
        if name not in arrays:
            raise FormatError(f"array {name!r} is missing", path=path)
    return arrays

"""NPZ files of named arrays. Equal arrays make equal bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import writing
from polarsim.formats.readers import reader


def write_arrays(path: Path, packed: bool = True, **arrays: np.ndarray | np.generic) -> None:
    """Write an NPZ file. Without compression (`packed`), the file is larger and written in a tenth of the time."""
    save = np.savez_compressed if packed else np.savez
    with writing(path) as temporary:
        save(temporary, **arrays)  # type: ignore[arg-type]  # the type stub treats the names as options


@reader("NPZ file", largest_mb=4000)
def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Read an NPZ file that must contain the arrays `names`."""
    with np.load(path, allow_pickle=False) as content:
        arrays = {name: content[name] for name in content.files}
    for name in names:
        if name not in arrays:
            raise FormatError(f"array {name!r} is missing", path=path)
    return arrays

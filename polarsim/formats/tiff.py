"""Pictures of one channel with 32-bit floats, as TIFF."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import writing


def write_floats(path: str | Path, values: np.ndarray) -> None:
    """Write (h, w) values as float32, uncompressed; NaN stays NaN."""
    import tifffile

    assert values.ndim == 2
    with writing(path) as temporary:
        tifffile.imwrite(
            temporary, np.asarray(values, np.float32), photometric="minisblack", metadata=None, software=False
        )


def read_floats(path: str | Path) -> np.ndarray:
    """(h, w) float32.

    Raises
    ------
    FormatError
        No TIFF file of one channel with 32-bit floats.
    """
    import tifffile

    try:
        values = tifffile.imread(path)
    except Exception as error:  # a damaged TIFF makes the parser raise nearly anything
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise FormatError(f"no readable TIFF file, {reason}", path=path) from error
    if values.ndim != 2 or values.dtype != np.float32:
        raise FormatError(f"{values.dtype} with shape {values.shape}, expected one channel of 32-bit floats", path=path)
    return np.asarray(values)

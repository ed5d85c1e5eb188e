"""`rock_translations.csv`: corrections of the positions of published rock meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import tables
from polarsim.formats.readers import reader
from polarsim.schemas.stages import TRANSLATIONS

FILE = "rock_translations.csv"
TRANSLATION_COLUMNS = ("dx_mm", "dy_mm", "dz_mm")
COLUMNS = TRANSLATIONS.columns


@reader("rock shifts")
def read_translations(cameras: Path) -> dict[int, np.ndarray]:
    """Read the translation (3,) of each rock by id, metres, sandbox frame; empty if the table does not exist."""
    path = cameras / FILE
    if not path.is_file():
        return {}
    table = tables.read_csv(path, COLUMNS)
    translations = table[list(TRANSLATION_COLUMNS)].to_numpy(float) / 1000
    if not np.isfinite(translations).all():
        raise FormatError("a translation is not finite", path=path)
    return dict(zip(table["rock"].astype(int).tolist(), translations, strict=True))

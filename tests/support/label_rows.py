"""Rows of label tables."""

from polarsim.formats.tables import key_columns
from polarsim.photo import PhotoKey

EDGES = ("x0", "y0", "x1", "y1")


def label_row(key: PhotoKey | str, kind="rock", rock=1, box=(400, 300, 800, 500), **changes) -> dict[str, object]:
    """Return a row; `changes` replace columns, by default source `seed` and confidence 1."""
    key = PhotoKey.parse(key) if isinstance(key, str) else key
    row = {"kind": kind, "rock": rock, "source": "seed", "confidence": 1.0} | changes
    return key_columns(key) | row | dict(zip(EDGES, map(float, box), strict=True))

"""One photo or twin with its labels drawn in: what `polarsim show KEY` writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import ConfigError, FormatError, about
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, label_table, read_parquet
from polarsim.formats.tone import to_8bit
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.tables.overlay import Marks, add_legend, draw_labels


def show(
    *,
    key: PhotoKey,
    picture: Path,
    labels: Sequence[Mapping[str, object]] | Path,
    out: Path,
    scale: float = 1.0,
    kinds: Sequence[str] = BOX_CLASSES,
    masks: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write a picture, tone-mapped to eight bits, with boxes, lines from shadows to rocks, ids, confidences, a legend.

    Parameters
    ----------
    picture
        A photo or twin (16 bits), or a picture of eight bits of the whole photo at any size.
    labels
        A label table, or rows with `LABEL_COLUMNS`; rows of other photos are passed over.
    scale
        Size of the result over that of the picture.
    kinds
        What is drawn: "rock", "shadow".
    masks : kind -> (h, w) bool
        Regions of the whole photo to fill; none when None.

    Raises
    ------
    FormatError
        The picture is no picture, or the table no label table.
    ConfigError
        A kind that no label has, or a scale that leaves no picture.
    """
    unknown = [kind for kind in kinds if kind not in BOX_CLASSES]
    if unknown:
        raise ConfigError(f"kind {unknown[0]!r}, expected {' or '.join(BOX_CLASSES)}")
    pixels = to_8bit(png.read(picture))
    width = round(scale * pixels.shape[1])
    if not 64 <= width <= 16384:
        raise ConfigError(f"scale {scale:g} makes a picture {width} px wide, expected 64 to 16384 px")
    if isinstance(labels, Path):
        with about(labels):
            rows = rows_of(read_parquet(labels, LABEL_COLUMNS), key)
    else:
        rows = rows_of(label_table([dict(row) for row in labels]), key)
    drawn = draw_labels(pixels, rows, width, Marks(kinds, links=True, shadow_ids=True), masks)
    png.write(out, add_legend(drawn, f"{key}, {picture.name}" if picture.stem != str(key) else str(key), rows, kinds))


def rows_of(table: pd.DataFrame, key: PhotoKey) -> pd.DataFrame:
    """The labels of one photo.

    Raises
    ------
    FormatError
        A label is of a kind that boxes do not have.
    """
    rows = table[table["key"] == str(key)]
    strange = [kind for kind in rows["kind"] if kind not in BOX_CLASSES]
    if strange:
        raise FormatError(f"label of kind {strange[0]!r} on {key}, expected {' or '.join(BOX_CLASSES)}")
    return rows

"""What followed from one drawing: labels with and without it, label by label."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import LabelError
from polarsim.formats.tables import write_parquet
from polarsim.labels.label import Label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PropagationInputs, labels_of_terrain
from polarsim.photo import PhotoKey
from polarsim.schemas.photos import UNDONE

COLUMNS = UNDONE.columns
LEAST_MOVE_PX = 0.5  # of an edge: less is no change

Labels = Mapping[PhotoKey, Sequence[Label]]


def what_followed(
    *,
    drawing: PhotoKey,
    inputs: PropagationInputs,
    options: LabelsOptions,
    out: Path,
) -> pd.DataFrame:
    """Propagate a terrain's labels twice, with a drawing and without it, and write what differs: rows of `followed`.

    Parameters
    ----------
    drawing
        The photo of a seed or of a correction.
    options
        Of the labels stage; the drawing must not be taken back in them.

    Raises
    ------
    LabelError
        Nobody drew in that photo, or what was drawn is taken back already.
    """
    if str(drawing) in options.taken_back:
        raise LabelError(f"{drawing} is taken back already (labels.taken_back)")

    def labels(without: tuple[str, ...]) -> Labels:
        return labels_of_terrain(inputs, options.model_copy(update={"taken_back": without}))

    found = followed(labels(options.taken_back), labels((*options.taken_back, str(drawing))))
    write_parquet(out, found)
    return found


def followed(with_it: Labels, without: Labels) -> pd.DataFrame:
    """A row a label that a drawing changed, with `COLUMNS`; `change` is what would happen without the drawing.

    `gone`: the label would not be there; `moved`: an edge would lie `moved_px` further; `new`: a label would be
    there that is not there now.
    """
    rows: list[tuple[object, ...]] = []
    for key in sorted({*with_it, *without}):
        now, then = _by_name(with_it.get(key, ())), _by_name(without.get(key, ()))
        for name in sorted({*now, *then}):
            moved = float(np.abs(now[name] - then[name]).max()) if name in now and name in then else np.nan
            change = "moved" if name in now and name in then else "gone" if name in now else "new"
            if not moved <= LEAST_MOVE_PX:
                rows.append((str(key), name[0], name[1], change, round(moved, 2)))
    types = {"key": str, "kind": str, "rock": np.int64, "change": str, "moved_px": float}
    return pd.DataFrame(rows, columns=list(COLUMNS)).astype(types)


def _by_name(labels: Sequence[Label]) -> dict[tuple[str, int, int], np.ndarray]:
    """Boxes (4,) by kind, rock and, of several of one rock, their number from left to right."""
    found: dict[tuple[str, int, int], np.ndarray] = {}
    for label in sorted(labels, key=lambda label: (label.kind, label.rock, *label.box.tolist())):
        number = sum(name[:2] == (label.kind, label.rock) for name in found)
        found[label.kind, label.rock, number] = label.box
    return found

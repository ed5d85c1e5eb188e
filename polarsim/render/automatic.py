"""Exact labels of the twins, from what every pixel's ray met: rock and shadow boxes, instance masks, label rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy import ndimage

from polarsim.formats import png, tables, yolo
from polarsim.formats.instances import ROCK_IDS, SHADOW_IDS
from polarsim.geometry.boxes import of_mask
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey
from polarsim.render.lamps import lit_by
from polarsim.render.layers import NO_LAMP
from polarsim.render.options import RenderOptions

_TOUCHING = np.ones((3, 3), bool)  # pixels that meet at a corner belong together


def boxes_of(ids: np.ndarray, options: RenderOptions) -> list[tuple[str, int, np.ndarray]]:
    """(kind, rock, box) of every rock and shadow that is large enough in a picture of ids (h, w), rocks first."""
    found = []
    for number, window in enumerate(ndimage.find_objects(ids.astype(np.int32)), 1):
        if window is None or number < ROCK_IDS:
            continue
        kind, rock = (ROCK, number - ROCK_IDS) if number < SHADOW_IDS else (SHADOW, number - SHADOW_IDS)
        least = options.min_rock_px if kind == ROCK else options.min_shadow_px
        box = box_of_parts(ids[window] == number, least, options.min_part_px)
        if box is not None:
            corner = [window[1].start, window[0].start]
            found.append((kind, rock, box + np.tile(corner, 2)))
    return found


def box_of_parts(mask: np.ndarray, least_px: int, least_part_px: int) -> np.ndarray | None:
    """(4,) box around the connected parts of at least `least_part_px`; None where they have fewer than `least_px`."""
    parts, _ = ndimage.label(mask, _TOUCHING)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    large = sizes >= least_part_px
    return of_mask(large[parts]) if sizes[large].sum() >= least_px else None


def label_view(
    keys: Sequence[PhotoKey], ids: Mapping[str, np.ndarray], boxes: Path, instances: Path, options: RenderOptions
) -> list[dict[str, object]]:
    """Write the labels of one view's twins, the same for all models and all exposures of a photo set; its label rows.

    Parameters
    ----------
    ids : lamp -> (h, w) uint16
        The view's `Rendering.ids`.
    boxes : Path
        Folder for `KEY.txt`; empty where no lamp is on, for nothing is to be seen there.
    instances : Path
        Folder for `TT_P_light_az_C.png`, the ids of a photo set.
    """
    found = {name: boxes_of(picture, options) for name, picture in ids.items()}
    rows: list[dict[str, object]] = []
    written = set()
    for key in keys:
        lamps = lit_by(key.light, key.azimuth)
        labels = found[lamps[0]] if lamps else []
        yolo.write_boxes(
            boxes / f"{key}.txt", np.array([BOX_CLASSES.index(kind) for kind, _, _ in labels], int),
            np.array([box for _, _, box in labels], float),
        )  # fmt: skip
        rows += [label_row(key, *label) for label in labels]
        if key.photo_set not in written:
            written.add(key.photo_set)
            name = str(key).rsplit("_", 1)[0]
            png.write(instances / f"{name}.png", ids[lamps[0] if lamps else NO_LAMP])
    return rows


def label_row(key: PhotoKey, kind: str, rock: int, box: np.ndarray) -> dict[str, object]:
    corners = dict(zip(("x0", "y0", "x1", "y1"), box.tolist(), strict=True))
    return {**tables.key_columns(key), "kind": kind, "rock": rock, "source": "rendered", "confidence": 1.0, **corners}

"""The published cover photos as a small real test: strokes taken out, paired with the boxes that people drew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect.dataset import BOX_COLUMNS
from polarsim.errors import DetectError
from polarsim.formats import png, release, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES, HEIGHT, ROCK, WIDTH, PhotoKey

from .strokes import drawn_boxes, erase_strokes, find_strokes

SOURCE = "drawn"  # of labels that people made
PAIRING_COLUMNS = ("key", "shown", "light", "azimuth", "camera", "drawn", "labels", "matched", "score")


def pair_covers(root: Path, keys: Sequence[PhotoKey], pairing: Path) -> None:
    """Write how well the boxes drawn into each cover photo fit the labels of every photo of its position.

    A row a cover photo and exposure bracket (`shown`: the one that the keys name): boxes drawn, labels of rocks,
    pairs of the
    best assignment that overlap at all, and `score`, the summed IoU of these over the larger of the two numbers.
    Exposures of an exposure bracket share their labels, so the named key's stands for all.
    """
    rows = []
    for key in keys:
        drawn = drawn_boxes(find_strokes(read_cover(root, key)))
        for other, path in release.label_files(root, key.terrain).items():
            if other.position != key.position or other.exposure_ms != key.exposure_ms:
                continue
            classes, corners = yolo.read_boxes(path)
            rocks = corners[classes == BOX_CLASSES.index(ROCK)]
            overlap = boxes.iou(drawn, rocks) if len(drawn) and len(rocks) else np.zeros((len(drawn), len(rocks)))
            first, second = boxes.match_sum(overlap)
            total = overlap[first, second]
            most = max(len(drawn), len(rocks), 1)
            rows.append(
                (str(key), other == key, other.light, other.azimuth, other.camera, len(drawn), len(rocks),
                 int((total > 0).sum()), total.sum() / most)
            )  # fmt: skip
    tables.write_csv(pairing, pd.DataFrame(rows, columns=list(PAIRING_COLUMNS)).round({"score": 3}))


def read_cover(root: Path, key: PhotoKey) -> np.ndarray:
    """(h, w, 3) uint8 cover photo of a key's position.

    Raises
    ------
    DetectError
        There is none, or it is no colour picture of a photo's size.
    """
    path = release.cover_photos(root, key.terrain).get(key.position)
    if path is None:
        raise DetectError(f"no cover photo of terrain {key.terrain:02d}, position {key.position}", path=root)
    picture = png.read(path)
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[:2] != (HEIGHT, WIDTH):
        raise DetectError(
            f"shape {picture.shape} {picture.dtype}, expected {HEIGHT} x {WIDTH} in colour, 8 bits", path=path
        )
    return picture[..., :3]


def read_covers(*, root: Path, keys: Sequence[PhotoKey], pictures: Path, labels: Path) -> None:
    """Write each cover photo without its strokes as `KEY.png` (8 bits, full size), and the label table of their keys.

    Raises
    ------
    PolarsimError
        A cover photo or label file is missing or broken.
    """
    rows = []
    with writing_folder(pictures) as folder:
        for key in keys:
            png.write(folder / f"{key}.png", erase_strokes(read_cover(root, key)))
            path = release.label_files(root, key.terrain).get(key)
            if path is None:
                raise DetectError(f"no label file {key}.txt", path=root)
            classes, corners = yolo.read_boxes(path)
            facts = {"key": str(key), **{name: getattr(key, name) for name in (
                "terrain", "position", "light", "azimuth", "camera", "exposure_ms"
            )}}  # fmt: skip
            for kind, box in zip(classes, corners, strict=True):
                rows.append(
                    facts
                    | {"kind": BOX_CLASSES[kind], "rock": -1, "source": SOURCE, "confidence": 1.0}
                    | dict(zip(BOX_COLUMNS, box.tolist(), strict=True))
                )
    tables.write_parquet(labels, tables.label_table(rows))

"""Small copies of many pictures, labels drawn in, on one sheet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, sqrt
from pathlib import Path

import numpy as np

from polarsim.formats import coco
from polarsim.formats.files import writing
from polarsim.photo import BLACK_LEVEL, ROCK, SHADOW
from polarsim.randomness import generator

Tone = Callable[[np.ndarray], np.ndarray]  # (h, w) uint16 of 12 bits to (h, w, 3) uint8
MOST = 1024  # pictures on a sheet; of more a seeded choice
_WIDTH, _WIDEST, _GAP = 4000, 480, 2  # px: of the sheet, of one picture, between two
_NAMED_FROM = 300  # px: narrower pictures have no room for a name
_COLOURS = {ROCK: (255, 176, 0), SHADOW: (70, 190, 255)}


class Sheet:
    """Takes pictures as they come, in any order."""

    def __init__(self, names: Sequence[str], size: tuple[int, int], tone: Tone) -> None:
        """`size`: width and height of the pictures, px."""
        chosen = np.arange(len(names))
        if len(names) > MOST:
            chosen = np.sort(generator(0, "views", "sheet").choice(len(names), MOST, replace=False))
        self._place = {names[number]: place for place, number in enumerate(chosen.tolist())}
        self._columns = max(1, ceil(sqrt(len(chosen))))
        self._wide = min(_WIDEST, _WIDTH // self._columns - _GAP, size[0])
        self._high = max(1, round(self._wide * size[1] / size[0]))
        rows = ceil(len(chosen) / self._columns)
        self._tone = tone
        self._pixels = np.full((rows * (self._high + _GAP), self._columns * (self._wide + _GAP), 3), 255, np.uint8)

    def wants(self, name: str) -> bool:
        return name in self._place

    def add(self, name: str, picture: np.ndarray, labels: Sequence[coco.Annotation]) -> None:
        """Put a picture (h, w), uint16 of 12 bits or uint8, at its place."""
        import cv2

        size = (self._wide, self._high)
        small = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        eight = picture.dtype == np.uint8
        tile = (
            np.repeat(np.round(small).astype(np.uint8)[..., None], 3, axis=2)
            if eight
            else self._tone(np.round(np.maximum(small, BLACK_LEVEL)).astype(np.uint16))
        )
        tile = np.ascontiguousarray(tile)
        scale = self._wide / picture.shape[1]
        for label in sorted(labels, key=lambda label: label.kind, reverse=True):  # rocks on top
            x0, y0, x1, y1 = (round(float(edge) * scale) for edge in label.box)
            cv2.rectangle(tile, (x0, y0), (x1 - 1, y1 - 1), _COLOURS[label.kind], 1)
        if self._wide >= _NAMED_FROM:
            cv2.putText(
                tile, name, (4, self._high - 6), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (255, 255, 255), 1, cv2.LINE_AA
            )
        row, column = divmod(self._place[name], self._columns)
        top, left = row * (self._high + _GAP), column * (self._wide + _GAP)
        self._pixels[top : top + self._high, left : left + self._wide] = tile

    def write(self, path: str | Path) -> None:
        """Write a JPEG."""
        import cv2

        done, coded = cv2.imencode(".jpg", self._pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
        assert done
        with writing(path) as temporary:
            temporary.write_bytes(coded.tobytes())

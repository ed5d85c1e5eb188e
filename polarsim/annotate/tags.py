"""Words beside boxes, each at a place where no other one stands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

Rectangle = tuple[float, float, float, float]
Colour = tuple[int, int, int]


class Tags:
    """Writes on a picture and remembers where it has written.

    Parameters
    ----------
    pen
        Pillow's `ImageDraw` of the picture.
    size
        Width and height of the picture, pixels.
    line
        Width of the boxes' lines, pixels: the words stay clear of them.
    """

    def __init__(self, pen: Any, size: tuple[int, int], line: int) -> None:
        self._pen, self._size, self._line = pen, size, line
        self._taken: list[Rectangle] = []

    def write(self, text: str, box: Sequence[float], colour: Colour, letters: Any) -> None:
        """Write beside a box, at the first place that is free, or else where the fewest other words are."""
        left, top, right, bottom = self._pen.textbbox((0, 0), text, font=letters)
        places = self._places(right - left + 2 * self._line, bottom - top + 2 * self._line, box)
        place = min(places, key=lambda place: sum(_common_area(place, other) for other in self._taken))
        self._taken.append(place)
        origin = (round(place[0]) + self._line - left, round(place[1]) + self._line - top)
        stroke = max(1, self._line)
        self._pen.text(origin, text, fill=colour, font=letters, stroke_width=stroke, stroke_fill=(0, 0, 0))

    def _places(self, wide: float, high: float, box: Sequence[float]) -> list[Rectangle]:
        """Above and below the box at either end, then left and right of it; inside the picture."""
        gap, (left, top, right, bottom) = self._line, box
        above, below, before, behind = top - high - gap, bottom + gap, left - wide - gap, right + gap
        corners = [(left, above), (right - wide, above), (left, below), (right - wide, below)]
        corners += [(behind, top), (before, top), (behind, bottom - high), (before, bottom - high)]
        room = np.array(self._size) - (wide, high)
        return [(x, y, x + wide, y + high) for x, y in np.clip(corners, 0, np.maximum(room, 0)).tolist()]


def font(size: int) -> Any:
    """Matplotlib brings the same font to every machine."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)


def _common_area(first: Rectangle, second: Rectangle) -> float:
    wide = min(first[2], second[2]) - max(first[0], second[0])
    high = min(first[3], second[3]) - max(first[1], second[1])
    return max(wide, 0) * max(high, 0)

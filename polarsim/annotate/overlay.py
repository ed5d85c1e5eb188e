"""Rendering of labels on an image: masks, boxes, lines from shadows to rocks, rock ids, confidences and a legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import dist
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.photo import BOX_CLASSES, COLOURS, NO_ROCK, ROCK, SHADOW

Rectangle = tuple[float, float, float, float]
Colour = tuple[int, int, int]
LINK = (120, 245, 255)  # colour of lines from shadows to rocks: a brighter tone of the shadow boxes
INK, PAPER = (32, 33, 36), (255, 255, 255)
_FILL = 0.35  # opacity of masks
_BOX_COST = 0.15  # cost of covered boxes relative to covered texts
_FAR_COST = 0.2  # cost of a text away from its box, as share of the area of the text
STATED_BELOW = 0.9  # confidence of labels, by default
_SMALL = 0.75  # font size of shadow ids relative to rock ids


class Tags:
    """Text next to boxes, placed to avoid earlier texts and `boxes`; `line`: line width and minimum distance, px."""

    def __init__(self, pen: Any, size: tuple[int, int], line: int, boxes: Sequence[Rectangle] = ()) -> None:
        self._pen, self._size, self._line = pen, size, line
        self._obstacles = [*boxes]
        self._weights = [_BOX_COST] * len(self._obstacles)

    def write(self, text: str, box: Sequence[float], colour: Colour, letters: Any) -> None:
        """Write a text next to a box, at the first position with the minimum overlap with earlier texts and boxes.

        A text that does not touch its box is joined to it by a line.
        """
        left, top, right, bottom = self._pen.textbbox((0, 0), text, font=letters)
        wide, high = right - left + 2 * self._line, bottom - top + 2 * self._line
        chosen, near_cost = self._cheapest(self._candidates(wide, high, box, 0))
        if near_cost:
            farther, cost = self._cheapest(self._candidates(wide, high, box, 1.2 * high))
            if cost + _FAR_COST * wide * high < near_cost:
                chosen = farther
                self._join(chosen, box, colour)
        self._obstacles.append(chosen)
        self._weights.append(1.0)
        origin = (round(chosen[0]) + self._line - left, round(chosen[1]) + self._line - top)
        stroke = max(1, self._line)
        self._pen.text(origin, text, fill=colour, font=letters, stroke_width=stroke, stroke_fill=(0, 0, 0))

    def _cheapest(self, places: Sequence[Rectangle]) -> tuple[Rectangle, float]:
        """Return the first place with the minimum cost, and the cost: the area of covered texts, and less for boxes."""
        if not self._obstacles:
            return places[0], 0.0
        place, obstacle = np.array(places)[:, None], np.array(self._obstacles)[None]
        low, high = np.maximum(place[..., :2], obstacle[..., :2]), np.minimum(place[..., 2:], obstacle[..., 2:])
        costs = (high - low).clip(0).prod(axis=-1) @ self._weights
        best = int(costs.argmin())
        return places[best], float(costs[best])

    def _join(self, place: Rectangle, box: Sequence[float], colour: Colour) -> None:
        """Draw a line from the point of a text that is nearest to the box's centre to the nearest point of the box."""
        centre = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
        start = _nearest_point(place, centre)
        end = _nearest_point((box[0], box[1], box[2], box[3]), start)
        self._pen.line([start, end], fill=(0, 0, 0), width=self._line + 2)
        self._pen.line([start, end], fill=colour, width=max(1, self._line - 1))

    def _candidates(self, wide: float, high: float, box: Sequence[float], off: float) -> list[Rectangle]:
        """Return positions above and below the corners of a box, then left and right of the box, inside the image.

        The positions are `off` pixels away from the box.
        """
        gap, (left, top, right, bottom) = self._line + off, box
        above, below, before, after = top - high - gap, bottom + gap, left - wide - gap, right + gap
        corners = [(left, above), (right - wide, above), (left, below), (right - wide, below)]
        corners += [(after, top), (before, top), (after, bottom - high), (before, bottom - high)]
        if off:
            corners += [(after, above), (before, above), (after, below), (before, below)]
        space = np.array(self._size) - (wide, high)
        return [(x, y, x + wide, y + high) for x, y in np.clip(corners, 0, np.maximum(space, 0)).tolist()]


def _nearest_point(place: Rectangle, point: tuple[float, float]) -> tuple[float, float]:
    """Return the point of a rectangle that is nearest to a point."""
    return min(max(point[0], place[0]), place[2]), min(max(point[1], place[1]), place[3])


def font(size: int) -> Any:
    """Return the font that Matplotlib installs, which is the same on all machines."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)


@dataclass(frozen=True)
class OverlayStyle:
    """Style of an overlay."""

    kinds: Sequence[str] = BOX_CLASSES
    links: bool = False
    shadow_ids: bool = False
    stated_below: float = STATED_BELOW  # labels with a lower confidence state it; 0: none
    doubtful_below: float = 0.0  # boxes with a lower confidence are dashed
    letter_px: int = 0  # font size of ids; 0: proportional to the image width, minimum 10


@dataclass(frozen=True)
class _Label:
    """Label with the box (x0, y0, x1, y1) in pixels of the output image."""

    kind: str
    rock: int
    confidence: float
    box: tuple[float, float, float, float]

    @property
    def centre(self) -> tuple[float, float]:
        return (self.box[0] + self.box[2]) / 2, (self.box[1] + self.box[3]) / 2

    def tag(self, marks: OverlayStyle) -> str:
        """Return the rock id, followed by the confidence (.85) if it is below `stated_below`."""
        named = self.rock != NO_ROCK and (self.kind == ROCK or marks.shadow_ids)
        doubted = self.confidence < marks.stated_below
        return " ".join([str(self.rock)] * named + [f"{self.confidence:.2f}".removeprefix("0")] * doubted)


def draw_labels(
    pixels: np.ndarray,
    labels: pd.DataFrame,
    width: int | None = None,
    marks: OverlayStyle | None = None,
    masks: Mapping[str, np.ndarray] | None = None,
    *,
    photo_width: int | None = None,
) -> np.ndarray:
    """Draw labels on a resized image.

    Parameters
    ----------
    pixels : (h, w) or (h, w, 3) uint8
        The photo at any scale; the result has the same aspect and `width` pixels per row.
    labels
        Rows with kind, rock, confidence, x0, y0, x1, y1 in pixels of the full-size photo.
    masks : kind -> (h, w) bool
        Masks of the photo, at any scale, which are filled with the colour of the kind.
    photo_width
        Width of the full-size photo, px; default: that of `pixels`.
    """
    from PIL import Image, ImageDraw

    marks = marks or OverlayStyle()
    width = width or pixels.shape[1]
    size = (width, round(pixels.shape[0] * width / pixels.shape[1]))
    picture = Image.fromarray(np.ascontiguousarray(pixels)).resize(size, Image.Resampling.LANCZOS).convert("RGB")
    for kind in _bottom_up(marks.kinds):
        if masks and kind in masks:
            _fill(picture, masks[kind], COLOURS[kind])
    pen = ImageDraw.Draw(picture)
    line = max(2 if width >= 600 else 1, round(width / 700))
    scale = width / (photo_width or pixels.shape[1])
    shown = [label for kind in _bottom_up(marks.kinds) for label in _labels(labels, kind, scale)]
    if marks.links:
        _draw_links(pen, shown, line)
    for label in shown:
        _draw_box(pen, label.box, COLOURS[label.kind], line, dashed=label.confidence < marks.doubtful_below)
    tags = Tags(pen, size, line, [label.box for label in shown if label.kind == ROCK])
    large = marks.letter_px or max(10, round(width / 62))
    letters = {ROCK: font(large), SHADOW: font(max(9, round(_SMALL * large)) if marks.shadow_ids else large)}
    for label in reversed(shown):  # rocks first, because the first texts get the best positions
        text = label.tag(marks)
        if text:
            tags.write(text, label.box, COLOURS[label.kind], letters[label.kind])
    return np.asarray(picture)


def add_legend(pixels: np.ndarray, title: str, labels: pd.DataFrame, kinds: Sequence[str] = BOX_CLASSES) -> np.ndarray:
    """Append a strip with the title, the colours and the number of labels of each kind to an image (h, w, 3)."""
    from PIL import Image, ImageDraw

    width = pixels.shape[1]
    size = max(11, round(width / 70))
    strip = Image.new("RGB", (width, round(2.2 * size)), PAPER)
    pen, letters, centre = ImageDraw.Draw(strip), font(size), round(1.1 * size)
    pen.text((size, centre), title, fill=INK, font=letters, anchor="lm")
    x = width - size
    for kind in _bottom_up(kinds):
        text = f"{kind} ({int((labels['kind'] == kind).sum())})"
        x -= round(pen.textlength(text, font=letters))
        pen.text((x, centre), text, fill=INK, font=letters, anchor="lm")
        x -= round(1.4 * size)
        pen.rectangle([x, centre - size // 2, x + size, centre + size // 2], outline=INK, fill=COLOURS[kind])
        x -= size
    return np.concatenate([pixels, np.asarray(strip)])


def _bottom_up(kinds: Sequence[str]) -> list[str]:
    """Return the kinds in drawing order: rocks are drawn on top."""
    return [kind for kind in reversed(BOX_CLASSES) if kind in kinds]


def _labels(table: pd.DataFrame, kind: str, scale: float) -> list[_Label]:
    part = table[table["kind"] == kind].sort_values(["rock", "x0", "y0"], kind="stable")
    boxes = part[["x0", "y0", "x1", "y1"]].to_numpy(float) * scale
    rows = zip(part["rock"], part["confidence"], boxes.tolist(), strict=True)
    return [_Label(kind, int(rock), float(confidence), tuple(box)) for rock, confidence, box in rows]


def _fill(picture: Any, mask: np.ndarray, colour: Colour) -> None:
    """Tint the part of an image that a mask covers."""
    from PIL import Image

    cover = Image.fromarray((mask * round(255 * _FILL)).astype(np.uint8)).resize(picture.size, Image.Resampling.BOX)
    picture.paste(colour, (0, 0, *picture.size), cover)


def _draw_links(pen: Any, labels: Sequence[_Label], line: int) -> None:
    """Draw a line from the centre of every shadow to the centre of the nearest rock with the same id."""
    thin = max(min(line, 2), round(0.6 * line))
    rim, dot = thin + 2 * (line > 1), max(1.5, 1.3 * line)
    rocks = [label for label in labels if label.kind == ROCK and label.rock != NO_ROCK]
    for shadow in (label for label in labels if label.kind == SHADOW):
        ends = [rock.centre for rock in rocks if rock.rock == shadow.rock]
        if ends:
            x, y = min(ends, key=lambda end: (dist(end, shadow.centre), end))
            # The rim is dark, because sand may be as bright as the line.
            pen.line([shadow.centre, (x, y)], fill=(0, 0, 0), width=rim)
            pen.line([shadow.centre, (x, y)], fill=LINK, width=thin)
            pen.ellipse([x - dot, y - dot, x + dot, y + dot], fill=LINK, outline=(0, 0, 0))


def _draw_box(pen: Any, box: Sequence[float], colour: Colour, line: int, *, dashed: bool) -> None:
    x0, y0, x1, y1 = (round(value) for value in box)
    if not dashed:
        pen.rectangle([x0, y0, x1, y1], outline=colour, width=line)
        return
    dash = 3 * line
    for x in range(x0, x1 + 1, 2 * dash):
        for y in (y0, y1 - line + 1):
            pen.rectangle([x, y, min(x + dash - 1, x1), y + line - 1], fill=colour)
    for y in range(y0, y1 + 1, 2 * dash):
        for x in (x0, x1 - line + 1):
            pen.rectangle([x, y, x + line - 1, min(y + dash - 1, y1)], fill=colour)

"""Labels drawn into a picture: boxes by kind, rock ids, confidences, a legend below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, WIDTH

COLOURS = {ROCK: (255, 176, 0), SHADOW: (70, 190, 255)}  # apart for colour-blind eyes too, and from any grey
INK, PAPER = (32, 33, 36), (255, 255, 255)
_TAG_PLACES = ("above left", "above right", "below left", "below right")


def draw_labels(
    pixels: np.ndarray, labels: pd.DataFrame, width: int | None = None, kinds: Sequence[str] = BOX_CLASSES
) -> np.ndarray:
    """A picture with its labels, scaled.

    Parameters
    ----------
    pixels : (h, w, 3) uint8
        The whole photo at any scale.
    labels
        Rows with kind, rock, confidence, x0, y0, x1, y1 in pixels of the full photo.
    width
        Width of the result in pixels; as the picture when None.

    Returns
    -------
    (h', width, 3) uint8
    """
    from PIL import Image, ImageDraw

    width = width or pixels.shape[1]
    height = round(pixels.shape[0] * width / pixels.shape[1])
    picture = Image.fromarray(np.ascontiguousarray(pixels)).resize((width, height), Image.Resampling.LANCZOS)
    pen = ImageDraw.Draw(picture)
    line = max(2 if width >= 600 else 1, round(width / 700))
    font = _font(max(10, round(width / 62)))
    rows = [row for kind in reversed(BOX_CLASSES) if kind in kinds for row in _rows(labels, kind)]  # rocks on top
    boxes = [tuple(value * width / WIDTH for value in (row["x0"], row["y0"], row["x1"], row["y1"])) for row in rows]
    for row, box in zip(rows, boxes, strict=True):
        pen.rectangle([round(value) for value in box], outline=COLOURS[row["kind"]], width=line)
    taken: list[tuple[float, float, float, float]] = []
    for row, box in zip(reversed(rows), reversed(boxes), strict=True):  # rocks choose their places first
        text = _tag(row)
        if text:
            taken.append(_write_tag(pen, text, COLOURS[row["kind"]], box, (width, height), taken, font, line))
    return np.asarray(picture)


def add_legend(pixels: np.ndarray, title: str, labels: pd.DataFrame, kinds: Sequence[str] = BOX_CLASSES) -> np.ndarray:
    """The picture (h, w, 3) on a strip that names it, the colours, and how many labels of each kind there are."""
    from PIL import Image, ImageDraw

    width = pixels.shape[1]
    size = max(11, round(width / 70))
    strip = Image.new("RGB", (width, round(2.2 * size)), PAPER)
    pen, font, middle = ImageDraw.Draw(strip), _font(size), round(1.1 * size)
    pen.text((size, middle), title, fill=INK, font=font, anchor="lm")
    place = width - size
    for kind in reversed([kind for kind in BOX_CLASSES if kind in kinds]):
        text = f"{kind} ({int((labels['kind'] == kind).sum())})"
        place -= round(pen.textlength(text, font=font))
        pen.text((place, middle), text, fill=INK, font=font, anchor="lm")
        place -= round(1.4 * size)
        pen.rectangle([place, middle - size // 2, place + size, middle + size // 2], outline=INK, fill=COLOURS[kind])
        place -= size
    return np.concatenate([pixels, np.asarray(strip)])


def _rows(labels: pd.DataFrame, kind: str) -> list[dict[str, Any]]:
    part = labels[labels["kind"] == kind].sort_values(["rock", "x0", "y0"], kind="stable")
    return [{str(name): value for name, value in row.items()} for row in part.to_dict("records")]


def _tag(row: dict[str, Any]) -> str:
    """Rock id, and the confidence where it is not full; shadows show a confidence alone."""
    confidence = float(row.get("confidence", 1.0))
    parts = [str(int(row["rock"]))] if row["kind"] == ROCK and int(row["rock"]) != NO_ROCK else []
    return " ".join([*parts, f"{confidence:.2f}"] if confidence < 0.995 else parts)


def _write_tag(
    pen: Any,
    text: str,
    colour: tuple[int, int, int],
    box: tuple[float, ...],
    size: tuple[int, int],
    taken: list[tuple[float, float, float, float]],
    font: Any,
    line: int,
) -> tuple[float, float, float, float]:
    """Write beside a box, at the first place that is free; the place taken."""
    left, top, right, bottom = pen.textbbox((0, 0), text, font=font)
    wide, high = right - left + 2 * line, bottom - top + 2 * line
    places = []
    for name in _TAG_PLACES:
        x = box[0] if "left" in name else box[2] - wide
        y = box[1] - high - line if "above" in name else box[3] + line
        x, y = float(np.clip(x, 0, size[0] - wide)), float(np.clip(y, 0, size[1] - high))
        places.append((x, y, x + wide, y + high))
    place = next((place for place in places if not any(_meet(place, other) for other in taken)), places[0])
    origin = (round(place[0]) + line - left, round(place[1]) + line - top)
    pen.text(origin, text, fill=colour, font=font, stroke_width=max(1, line), stroke_fill=(0, 0, 0))
    return place


def _meet(first: tuple[float, ...], second: tuple[float, ...]) -> bool:
    return first[0] < second[2] and second[0] < first[2] and first[1] < second[3] and second[1] < first[3]


def _font(size: int) -> Any:
    """Matplotlib brings the same font to every machine."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)

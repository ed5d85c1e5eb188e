"""The page that figures are drawn on: one look, no window, the same bytes every time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats.files import writing

DPI = 100
FIGURE_WIDTH = 1600  # px: what a screen shows at once
NOTE_LETTERS = 70  # of a line: what fits on the page, for letters grow with it
COLUMN_IN, PRINTED_PT = 3.5, 7.5  # a column of a paper's page, and letters on it
INK, FAINT, LINE = "#202124", "#5f6368", "#dadce0"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8c6d1f", "#56b4e9")  # Okabe and Ito: apart for all eyes
LETTER_M = (0.09, 0.13)  # metres: width and height of a digit on a map of the sandbox that fills half the page
PLAIN = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}  # behind words on a map
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 12,
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlesize": 13,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": LINE,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@contextmanager
def page(path: Path, width_px: int, height_px: int, printed_in: float | None = None) -> Iterator[Any]:
    """A Matplotlib figure, written to a PNG of that size at the end; fonts grow with the width from 1200 px on.

    `printed_in`: it is for print, so many inches wide: fonts then have the sizes of a paper's captions.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    dpi = width_px / printed_in if printed_in else DPI
    zoom = PRINTED_PT / 12 if printed_in else max(1.0, width_px / 1300)
    style: Any = {**_STYLE, "font.size": 12 * zoom, "axes.titlesize": 13 * zoom}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(width_px / dpi, height_px / dpi), dpi=dpi, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        with writing(path) as temporary:
            figure.savefig(temporary, metadata={"Software": None})


def heading(figure: Any, text: str) -> None:
    """The title of all panels."""
    figure.suptitle(text, x=0.01, ha="left")


def legend_line(**look: Any) -> Any:
    """A line that stands in a legend alone."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **look)


def rectangle(axes: Any, box: Any, colour: str, **look: Any) -> None:
    """The outline of a box (x0, y0, x1, y1)."""
    from matplotlib.patches import Rectangle

    x0, y0, x1, y1 = box
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=colour, **look))


def beside(
    boxes: Mapping[str, tuple[float, float, float, float]], letter: tuple[float, float]
) -> dict[str, tuple[float, float]]:
    """Where the middle of each name stands: beside its box (x0, y0, x1, y1), y upwards, where it hides the least.

    `letter`: width and height of a letter in the boxes' units.
    """
    taken, positions = [(x0, y0, x1, y1, 0.3) for x0, y0, x1, y1 in boxes.values()], {}
    for name, (x0, y0, x1, y1) in sorted(boxes.items(), key=lambda item: (-item[1][3], item[0])):
        wide, high = letter[0] * len(name) / 2, letter[1] / 2
        x, y = (x0 + x1) / 2, (y0 + y1) / 2
        tried = [(x, y1 + high), (x, y0 - high), (x1 + wide, y), (x0 - wide, y)]
        tried += [(x + side * wide * 2, y + up * (y1 - y + high)) for side in (1, -1) for up in (1, -1)]
        tried += [(x, y1 + 3 * high), (x, y0 - 3 * high)]

        def hidden(position: tuple[float, float], wide: float = wide, high: float = high) -> float:
            left, low, right, top = position[0] - wide, position[1] - high, position[0] + wide, position[1] + high
            return sum(
                weight * max(0, min(right, c) - max(left, a)) * max(0, min(top, d) - max(low, b))
                for a, b, c, d, weight in taken
            )

        positions[name] = min(tried, key=hidden)
        px, py = positions[name]
        taken.append((px - wide, py - high, px + wide, py + high, 1.0))
    return positions


def boxed(pixels: np.ndarray, boxes: Iterable[tuple[np.ndarray, tuple[int, int, int]]], width: int) -> np.ndarray:
    """(h', width, 3) uint8: a grey picture (h, w) scaled, with boxes (4,) in its own pixels, each in a colour (RGB)."""
    from PIL import Image, ImageDraw

    scale = width / pixels.shape[1]
    size = (width, round(width * pixels.shape[0] / pixels.shape[1]))
    image = Image.fromarray(pixels).resize(size, Image.Resampling.BOX).convert("RGB")
    pen, line = ImageDraw.Draw(image), max(1, round(width / 500))
    for box, colour in boxes:
        pen.rectangle([float(edge) for edge in scale * box], outline=colour, width=line)
    return np.asarray(image)


def note(figure: Any, text: str) -> None:
    """A figure that says why it shows nothing."""
    from textwrap import fill

    figure.text(0.5, 0.5, fill(text, NOTE_LETTERS), ha="center", va="center", color=FAINT, fontsize="large")


def picture(axes: Any, pixels: Any, title: str) -> None:
    """An image without frame."""
    axes.imshow(pixels, interpolation="antialiased")
    axes.set_title(title)
    axes.set_axis_off()

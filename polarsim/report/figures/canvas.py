"""Common style and drawing functions of figures; no window is opened and the same input gives the same bytes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import png
from polarsim.formats.files import writing
from polarsim.photo import HEX_COLOURS, ROCK

DPI = 100
FIGURE_WIDTH = 1600  # px, fits a screen
COMPRESSION = 3  # of PNG files: half the time of the default for photos, and files of the same size
NOTE_LETTERS = 70  # maximum line length of a note; the font grows with the figure
COLUMN_IN, PRINTED_PT = 3.5, 7.5  # width of a column of a paper, inches, and font size in it, points
INK, FAINT, LINE = "#202124", "#5f6368", "#dadce0"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8c6d1f", "#56b4e9")  # Okabe and Ito, for colour-blind readers
PREDICTED = "#ff4fa3"  # predicted boxes, distinct from the amber labels and from blue shadows for colour-blind readers
BOX_LEGEND = {"labelled rock": HEX_COLOURS[ROCK], "prediction": PREDICTED}
LETTER_M = (0.09, 0.13)  # width and height of a digit on a map of the sandbox of half the figure's width, metres
PLAIN = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}  # background of text on a map
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
    """Yield a Matplotlib figure and write it as a PNG of the given size; fonts grow with widths above 1300 px.

    `printed_in` is the width in print, inches; then the fonts have the size of a paper's captions.
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
            figure.savefig(temporary, metadata={"Software": None}, pil_kwargs={"compress_level": COMPRESSION})


def figure_title(figure: Any, text: str) -> None:
    """Write a title above all panels."""
    figure.suptitle(text, x=0.01, ha="left")


def legend_line(**style: Any) -> Any:
    """Return a line for a legend that is not part of the plot."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **style)


def box_legend(figure: Any, colours: Mapping[str, str], dashed: Collection[str] = ()) -> None:
    """Write the meaning of colours of boxes below all panels; `dashed`: meanings of dashed boxes."""
    lines = [
        legend_line(color=colour, linewidth=3, linestyle="--" if meaning in dashed else "-")
        for meaning, colour in colours.items()
    ]
    figure.legend(lines, list(colours), loc="outside lower center", ncols=len(lines))


def rgb(colour: str) -> tuple[int, int, int]:
    """Return the RGB values of a colour such as #ff4fa3."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def rectangle(axes: Any, box: Any, colour: str, **style: Any) -> None:
    """Draw the outline of a box (x0, y0, x1, y1)."""
    from matplotlib.patches import Rectangle

    x0, y0, x1, y1 = box
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=colour, **style))


def name_positions(
    boxes: Mapping[str, tuple[float, float, float, float]], letter: tuple[float, float]
) -> dict[str, tuple[float, float]]:
    """Return the centre of each name, next to the box (x0, y0, x1, y1; y upwards), with minimum overlap.

    `letter` is the width and height of a letter in the units of the boxes.
    """
    occupied, positions = [(x0, y0, x1, y1, 0.3) for x0, y0, x1, y1 in boxes.values()], {}
    for name, (x0, y0, x1, y1) in sorted(boxes.items(), key=lambda item: (-item[1][3], item[0])):
        half_width, half_height = letter[0] * len(name) / 2, letter[1] / 2
        x, y = (x0 + x1) / 2, (y0 + y1) / 2
        candidates = [(x, y1 + half_height), (x, y0 - half_height), (x1 + half_width, y), (x0 - half_width, y)]
        candidates += [
            (x + side * half_width * 2, y + up * (y1 - y + half_height)) for side in (1, -1) for up in (1, -1)
        ]
        candidates += [(x, y1 + 3 * half_height), (x, y0 - 3 * half_height)]

        def overlap(position: tuple[float, float], dx: float = half_width, dy: float = half_height) -> float:
            left, low, right, top = position[0] - dx, position[1] - dy, position[0] + dx, position[1] + dy
            return sum(
                weight * max(0, min(right, c) - max(left, a)) * max(0, min(top, d) - max(low, b))
                for a, b, c, d, weight in occupied
            )

        positions[name] = min(candidates, key=overlap)
        px, py = positions[name]
        occupied.append((px - half_width, py - half_height, px + half_width, py + half_height, 1.0))
    return positions


def boxed(pixels: np.ndarray, boxes: Iterable[tuple[np.ndarray, tuple[int, int, int]]], width: int) -> np.ndarray:
    """Scale a grey image (h, w) to `width` and draw boxes (4,), in pixels of the input, in RGB colours.

    Returns an array (h', width, 3) uint8.
    """
    from PIL import Image, ImageDraw

    scale = width / pixels.shape[1]
    size = (width, round(width * pixels.shape[0] / pixels.shape[1]))
    image = Image.fromarray(pixels).resize(size, Image.Resampling.BOX).convert("RGB")
    pen, line = ImageDraw.Draw(image), max(1, round(width / 500))
    for box, colour in boxes:
        pen.rectangle([float(edge) for edge in scale * box], outline=colour, width=line)
    return np.asarray(image)


def aspect_of(paths: Iterable[Path]) -> float:
    """Return the height over the width of the first image that exists; of no image 0."""
    for path in paths:
        if path.exists():
            header = png.parse_header(path.read_bytes())
            return header.height / header.width
    return 0.0


def note(figure: Any, text: str) -> None:
    """Write a text in an empty figure."""
    from textwrap import fill

    figure.text(0.5, 0.5, fill(text, NOTE_LETTERS), ha="center", va="center", color=FAINT, fontsize="large")


def show_image(axes: Any, pixels: Any, title: str) -> None:
    """Show an image without axes."""
    axes.imshow(pixels, interpolation="antialiased")
    axes.set_title(title)
    axes.set_axis_off()
    axes.set_anchor("N")  # keeps the title inside the figure

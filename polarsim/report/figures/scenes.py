"""Figure of randomised training scenes with labels, for the rocks of every terrain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.formats import png, yolo
from polarsim.photo import BOX_CLASSES, COLOURS, terrain_text
from polarsim.report.figures.canvas import FIGURE_WIDTH, boxed, page, show_image

_COLUMNS = 4  # images per terrain
_TITLE_PX = 40


def draw_scenes(*, scenes: Mapping[int, Path], figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write a row per terrain; `scenes` are folders with `images/NAME.png` and `labels/NAME.txt` by terrain."""
    column = width // _COLUMNS
    chosen = {terrain: _spread(folder) for terrain, folder in sorted(scenes.items())}
    first = png.read_png(next(path for paths in chosen.values() for path in paths))
    with page(figure, width, len(chosen) * (round(column * first.shape[0] / first.shape[1]) + _TITLE_PX)) as sheet:
        grid = sheet.subplots(len(chosen), _COLUMNS, squeeze=False)
        for row, (terrain, paths) in zip(grid, chosen.items(), strict=True):
            for axes in row[len(paths) :]:
                axes.set_axis_off()
            for axes, path in zip(row, paths, strict=False):
                show_image(axes, _with_labels(path, column), f"rocks of terrain {terrain_text(terrain)}")


def _spread(folder: Path) -> list[Path]:
    """Return images of a folder, evenly spaced in the order of names."""
    paths = sorted((folder / "images").glob("*.png"))
    chosen = np.unique(np.linspace(0, len(paths) - 1, _COLUMNS).round().astype(int))
    return [paths[number] for number in chosen]


def _with_labels(path: Path, width: int) -> np.ndarray:
    """Return a scaled image (h', width, 3) uint8 with the boxes of rocks and shadows."""
    pixels = png.read_png(path)
    labels = path.parents[1] / "labels" / f"{path.stem}.txt"
    classes, corners = yolo.read_boxes(labels, (pixels.shape[1], pixels.shape[0]))
    coloured = [(box, COLOURS[BOX_CLASSES[kind]]) for kind, box in zip(classes, corners, strict=True)]
    return boxed(pixels, coloured, width)

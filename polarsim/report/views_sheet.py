"""Contact sheet of novel views with labels: a row per reflectance model, a column per light."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.formats import png, tables, yolo
from polarsim.photo import BOX_CLASSES, COLOURS, HEX_COLOURS
from polarsim.report import paper
from polarsim.report.figures.canvas import box_legend, boxed, figure_title, page, show_image
from polarsim.tone import to_8bit

SHEET_WIDTH = 2400  # px
_COLUMNS = ["name", "model", "azimuth_deg", "elevation_deg"]
_TITLE_PX, _LEGEND_PX = 60, 130  # heights of the titles of a row, and of legend and title of the sheet


def draw_views(*, views: Path, title: str, figure: Path, width: int = SHEET_WIDTH) -> None:
    """Write the sheet of the images that `render_views` wrote to a folder, one per model and light."""
    index = tables.read_csv(views / "index.csv", _COLUMNS)
    models, lights = list(dict.fromkeys(index["model"])), list(dict.fromkeys(index["azimuth_deg"]))
    column = width // len(lights)
    shown = {name: _with_labels(views, str(name), column) for name in index["name"]}
    high = max(pixels.shape[0] for pixels in shown.values())
    with page(figure, width, len(models) * (high + _TITLE_PX) + _LEGEND_PX) as sheet:
        figure_title(sheet, title)
        grid = sheet.subplots(len(models), len(lights), squeeze=False)
        for name, model, azimuth, elevation in index[_COLUMNS].itertuples(index=False):
            axes = grid[models.index(model), lights.index(azimuth)]
            show_image(axes, shown[name], f"{paper.domain_title(model)}, Sun {azimuth:g}°, {elevation:g}° high")
        box_legend(sheet, {f"label of a {kind}": HEX_COLOURS[kind] for kind in BOX_CLASSES})


def _with_labels(views: Path, name: str, width: int) -> np.ndarray:
    """Return a scaled image (h, width, 3) uint8 with the boxes of rocks and shadows."""
    grey = to_8bit(png.read_png(views / f"images/{name}.png"))[..., 0]
    classes, corners = yolo.read_boxes(views / f"labels/{name}.txt", (grey.shape[1], grey.shape[0]))
    coloured = [(box, COLOURS[BOX_CLASSES[kind]]) for kind, box in zip(classes, corners, strict=True)]
    return boxed(np.ascontiguousarray(grey), sorted(coloured, key=lambda item: item[1]), width)

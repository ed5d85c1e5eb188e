"""Figures of image sequences of the rover's cameras during a drive, with boxes for the front camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import HEX_COLOURS, ROCK
from polarsim.report.figures.canvas import (
    FIGURE_WIDTH,
    PREDICTED,
    box_legend,
    figure_title,
    note,
    page,
    rectangle,
    show_image,
)
from polarsim.run_files.picture_sets import PictureSet, sun_title
from polarsim.tone import to_8bit

POSES, SHOTS = ["frame", "time_s"], 6
BOX = ["frame", "kind", "x0", "y0", "x1", "y1"]


def draw_sequence(*, view: Path, pictures: str, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write `SHOTS` images of a camera, evenly spaced over the drive; `pictures` is `<Sun>_<model>_<exposure>`."""
    _draw_shots(view, pictures, figure, width, truth=None, detections=None)


def draw_front(
    *,
    view: Path,
    pictures: str,
    truth: Path,
    detections: Path | None,
    confidence: float,
    figure: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write the sequence of `draw_sequence` with boxes of true rocks and, if given, predicted rocks.

    `confidence` is the minimum confidence of a shown prediction.
    """
    predicted = None
    if detections:
        predicted = read_parquet(detections, [*BOX, "confidence"])
        predicted = predicted[predicted["confidence"] >= confidence]
    _draw_shots(view, pictures, figure, width, truth=read_parquet(truth, BOX), detections=predicted)


def _draw_shots(
    view: Path, pictures: str, figure: Path, width: int, truth: pd.DataFrame | None, detections: pd.DataFrame | None
) -> None:
    poses = read_parquet(view / "poses.parquet", POSES)
    chosen = poses.iloc[np.unique(np.linspace(0, len(poses) - 1, SHOTS).round().astype(int))] if len(poses) else poses
    with page(figure, width, round(width * 0.5)) as sheet:
        if not len(chosen):
            note(sheet, "no images of this camera")
            return
        picture_set = PictureSet.parse(pictures)
        title = f"{view.name}, {sun_title(picture_set.sun)}, {picture_set.model}, {picture_set.exposure_ms:g} ms"
        panels = np.ravel(sheet.subplots(2, SHOTS // 2))
        for axes in panels:
            axes.set_axis_off()
        for axes, (frame, time_s) in zip(panels, chosen[POSES].itertuples(index=False), strict=False):
            pixels = png.read_png(view / pictures / f"{int(frame):05d}.png")
            show_image(axes, to_8bit(pixels), f"{time_s:.1f} s")
            for boxes, colour in ((truth, HEX_COLOURS[ROCK]), (detections, PREDICTED)):
                if boxes is not None:
                    of_frame = boxes[(boxes["frame"] == frame) & (boxes["kind"] == ROCK)]
                    for box in of_frame[BOX[2:]].to_numpy(float) - HALF_PIXEL:  # imshow: first pixel centre at 0
                        rectangle(axes, box, colour, linewidth=1)
        if truth is not None:
            predicted = {} if detections is None else {"predicted rock": PREDICTED}
            box_legend(sheet, {"true rock": HEX_COLOURS[ROCK], **predicted})
        figure_title(sheet, title)

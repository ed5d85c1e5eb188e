"""What cameras of the rover see on a drive: a sequence of moments, with boxes in it from the front camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import HEX_COLOURS, ROCK
from polarsim.report.figures.canvas import FIGURE_WIDTH, heading, note, page, picture, rectangle
from polarsim.run_files.picture_sets import PictureSet, sun_title
from polarsim.tone import to_8bit

POSES, SHOTS = ["frame", "time_s"], 6
BOX = ["frame", "kind", "x0", "y0", "x1", "y1"]
ROCKS, SEEN = HEX_COLOURS[ROCK], "#56b4e9"  # true rocks, and what a detector takes for one


def draw_sequence(*, view: Path, pictures: str, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write `SHOTS` moments of a view, evenly over the drive; `pictures` names the set, `<Sun>_<model>_<exposure>`."""
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
    """The same with boxes: true rocks, and, where a detector looked, what it takes for rocks with this confidence."""
    found = None
    if detections:
        found = read_parquet(detections, [*BOX, "confidence"])
        found = found[found["confidence"] >= confidence]
    _draw_shots(view, pictures, figure, width, truth=read_parquet(truth, BOX), detections=found)


def _draw_shots(
    view: Path, pictures: str, figure: Path, width: int, truth: pd.DataFrame | None, detections: pd.DataFrame | None
) -> None:
    poses = read_parquet(view / "poses.parquet", POSES)
    chosen = poses.iloc[np.unique(np.linspace(0, len(poses) - 1, SHOTS).round().astype(int))] if len(poses) else poses
    with page(figure, width, round(width * 0.5)) as sheet:
        if not len(chosen):
            note(sheet, "no picture was taken")
            return
        named = PictureSet.parse(pictures)
        title = f"{view.name}, {sun_title(named.sun)}, {named.model}, {named.exposure_ms:g} ms"
        panels = np.ravel(sheet.subplots(2, SHOTS // 2))
        for axes in panels:
            axes.set_axis_off()
        for axes, (frame, time_s) in zip(panels, chosen[POSES].itertuples(index=False), strict=False):
            pixels = png.read(view / pictures / f"{int(frame):05d}.png")
            picture(axes, to_8bit(pixels), f"{time_s:.1f} s")
            for boxes, colour in ((truth, ROCKS), (detections, SEEN)):
                if boxes is not None:
                    own = boxes[(boxes["frame"] == frame) & (boxes["kind"] == ROCK)]
                    for box in own[BOX[2:]].to_numpy(float) - HALF_PIXEL:  # imshow puts the first pixel's centre at 0
                        rectangle(axes, box, colour, linewidth=1)
        if truth is not None:
            title += "; yellow: rocks" + ("" if detections is None else ", blue: what the detector takes for rocks")
        heading(sheet, title)

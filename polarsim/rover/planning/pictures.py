"""Pictures of the front camera on an autonomous drive, with detected rocks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from polarsim.formats.files import write_bytes, writing_folder
from polarsim.photo import COLOURS, ROCK
from polarsim.rover.perception.observation import Observation

WIDTH_PX = 640
_QUALITY = 85
_BOX = COLOURS[ROCK][::-1]  # blue, green, red


def write_observations(folder: Path, observations: Iterable[tuple[float, Observation]]) -> None:
    """Write `<milliseconds>.jpg` of observations (time, s) with a picture; the folder is empty if there are none."""
    with writing_folder(folder) as temporary:
        for time_s, observation in observations:
            if observation.shown is not None:
                write_bytes(temporary / f"{1000 * time_s:07.0f}.jpg", _drawn(observation.shown, observation.found))


def _drawn(grey: np.ndarray, boxes: np.ndarray) -> bytes:
    """Return a JPEG of a picture (h, w) uint8 with boxes (n, 4+) in pixels."""
    import cv2

    scale = WIDTH_PX / grey.shape[1]
    size = (WIDTH_PX, round(scale * grey.shape[0]))
    canvas = cv2.cvtColor(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2BGR)
    for x0, y0, x1, y1 in np.rint(scale * boxes[:, :4]).astype(int):
        cv2.rectangle(canvas, (int(x0), int(y0)), (int(x1), int(y1)), _BOX, 2, cv2.LINE_AA)
    return bytes(cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1])

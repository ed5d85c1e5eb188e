"""The rover's drives for the page: map of the ground, path, images and their times."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.explore.pictures import jpeg
from polarsim.explore.terrain import as_rows
from polarsim.formats.npz import read_arrays
from polarsim.formats.tables import read_parquet

MAP_PX = 900  # longer side of the map
FRAME_PX = 960  # width of a frame
MIN_STEP = 0.02  # minimum distance between points of the path, metres


def drive_content(folder: Path) -> dict[str, Any]:
    """Return a drive: `map` (position and size, metres), `path` (x0, y0, x1, y1 ...), `rocks`, `views`.

    A view has the times of the frames, the positions of camera and rover (x0, y0, x1, y1 ...), and in `looks` the
    frames with an image by picture set (`Sun_model_exposure`).
    """
    ground = _ground(folder)
    trace = read_parquet(folder / "trace.parquet", ["time_s", "x_m", "y_m"])
    positions = trace[["x_m", "y_m"]].to_numpy(float)
    distance = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(positions, axis=0).T))])
    steps = np.arange(0, distance[-1] + MIN_STEP, MIN_STEP)
    kept = np.unique(np.searchsorted(distance, steps).clip(max=len(distance) - 1))
    rows, columns = ground["level_m"].shape
    cell = float(ground["cell_m"])
    return {
        "map": {
            "x0_m": float(ground["x0_m"]),
            "y0_m": float(ground["y0_m"]),
            "width_m": (columns - 1) * cell,
            "height_m": (rows - 1) * cell,
        },
        "length_m": round(float(distance[-1]), 3),
        "path": as_rows(positions[kept]),
        "rocks": _rocks(folder),
        "views": [_view(path, trace) for path in sorted(folder.glob("*/poses.parquet"))],
    }


def _rocks(folder: Path) -> list[dict[str, Any]]:
    """Return the rocks of the drive's world: terrain and rock id, position and size, metres."""
    path = folder / "world" / "rocks.parquet"
    if not path.exists():
        return []
    table = read_parquet(path, ["terrain", "rock_in_terrain", "x_m", "y_m", "radius_m"])
    return [
        {"rock": f"{row['terrain']}.{row['rock_in_terrain']}"}
        | {name: round(float(row[name]), 3) for name in ("x_m", "y_m", "radius_m")}
        for row in table.to_dict("records")
    ]


def _view(poses: Path, trace: pd.DataFrame) -> dict[str, Any]:
    table = read_parquet(poses, ["frame", "time_s", "x_m", "y_m"])
    picture_sets = {
        path.name: sorted(int(picture.stem) for picture in path.glob("[0-9]*.png"))
        for path in sorted(poses.parent.iterdir())
        if path.is_dir() and not path.name.endswith("_labels")
    }
    return {
        "name": poses.parent.name,
        "frames": [int(frame) for frame in table["frame"]],
        "time_s": as_rows(table["time_s"].to_numpy()),
        "positions": as_rows(table[["x_m", "y_m"]].to_numpy(float)),
        "rover": as_rows(
            np.stack([np.interp(table["time_s"], trace["time_s"], trace[name]) for name in ("x_m", "y_m")], 1)
        ),
        "looks": {name: frames for name, frames in picture_sets.items() if frames},
    }


def drive_pictures(folder: Path) -> dict[str, partial[bytes]]:
    """Return functions that encode the images of a drive (map and frames) by path below the drive."""
    encoders = {"map.jpg": partial(_map, folder)}
    for path in sorted(folder.glob("*/*/[0-9]*.png")):
        if not path.parent.name.endswith("_labels"):
            encoders[f"{path.parts[-3]}/{path.parts[-2]}/{path.stem}.jpg"] = partial(jpeg, path, FRAME_PX)
    return encoders


def _ground(folder: Path) -> dict[str, np.ndarray]:
    return read_arrays(folder / "world" / "ground.npz", ("x0_m", "y0_m", "cell_m", "level_m"))


def _map(folder: Path) -> bytes:
    """Return a JPEG of the ground from above, north (+y) up, lit from the north-west."""
    import cv2

    ground = _ground(folder)
    level, cell = ground["level_m"], float(ground["cell_m"])
    scale = min(1.0, MAP_PX / max(level.shape))
    size = (max(1, round(scale * level.shape[1])), max(1, round(scale * level.shape[0])))
    small = cv2.resize(np.asarray(level, np.float32), size, interpolation=cv2.INTER_AREA)
    down, right = np.gradient(small, cell / scale)
    light = (1 + right - down) / np.sqrt(2 * (1 + down**2 + right**2))  # of a lamp 45 degrees up, x right and y up
    dark, bright = np.percentile(light, [1, 99])
    shaded = (40 + 200 * np.clip((light - dark) / max(bright - dark, 1e-6), 0, 1)).astype(np.uint8)[::-1]
    done, content = cv2.imencode(".jpg", np.ascontiguousarray(shaded), [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert done
    return content.tobytes()

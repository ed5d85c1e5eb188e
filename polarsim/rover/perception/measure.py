"""Tables of the performance of a detector on a drive.

Output below a drive's folder, in `onboard/`: `sightings`, `stable`, `map` and `stops`. The column `source` is
`detector`; `truth`, all labels in the place of detections; or `visible`, labels with contrast in the picture, which is
the upper bound of a detector, since rocks in the rover's shadow are invisible.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect import tone
from polarsim.formats import png, tables
from polarsim.photo import ROCK
from polarsim.rover.cameras.layout import BOX, DETECTION_COLUMNS, TRUTH_COLUMNS, frame_files, picture_folder
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.perception import hazard_map, sightings
from polarsim.rover.perception.detections import boxes_with_contrast
from polarsim.rover.perception.ground_view import ground_below
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.perception.sightings import FrontCameraDrive
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.table import Vehicle

TABLES = ("sightings", "stable", "map", "stops")
SETTING_COLUMNS = ["seed", "sun", "model", "exposure_ms", "source"]  # columns that identify a metric
DETECTOR, TRUTH, VISIBLE = "detector", "truth", "visible"


def measure_drive(
    folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, onboard: OnboardDetector | None, seed: int
) -> dict[str, pd.DataFrame]:
    """Write the tables of a drive and return them by name."""
    suite = CameraSuite(read_trace(folder), vehicle, options, seed=seed)
    ride = front_camera_drive(suite)
    world, confidence = suite.trace.world, options.onboard.confidence
    true = hazard_map.true_map(world)
    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
    for row, truth, boxes in _cases(folder, suite, onboard):
        labelled = sightings.sightings(truth, boxes, confidence)
        stable = sightings.first_stable(labelled, ride.frames)
        gaps = {
            f"miss_{round(100 * height)}_cm_m": sightings.miss_distance(stable, world.rocks, ride, height)
            for height in sightings.HEIGHTS_M
        }
        stops = {"stops": sightings.false_stops(truth, boxes, ride, confidence), "length_m": ride.length_m, **gaps}
        estimated = hazard_map.map_from_boxes(boxes, ride, world, confidence)
        for name, table in (
            ("sightings", labelled),
            ("stable", stable.assign(stopping_m=ride.stopping_m)),
            ("map", hazard_map.compare_maps(estimated, true)),
            ("stops", pd.DataFrame([stops])),
        ):
            parts[name].append(table.assign(seed=seed, **row)[[*SETTING_COLUMNS, *table.columns]])
    joined = {name: pd.concat(tables_of_name, ignore_index=True) for name, tables_of_name in parts.items()}
    for name, table in joined.items():
        tables.write_parquet(folder / "onboard" / f"{name}.parquet", table)
    return joined


def front_camera_drive(suite: CameraSuite) -> FrontCameraDrive:
    """Return the front camera's drive for the metrics."""
    mount, vehicle, table = suite.mounts[FRONT], suite.vehicle, suite.trace.table
    wheels = vehicle.wheels
    paths = [table[[f"{wheel.code}_x_m", f"{wheel.code}_y_m"]].to_numpy() for wheel in wheels]
    positions = table[["x_m", "y_m"]].to_numpy()
    front = max(wheel.position_m[0] + wheel.outer_radius_m for wheel in wheels)
    return FrontCameraDrive(
        frames=suite.frames,
        cameras={frame: suite.camera(FRONT, frame) for frame in suite.frames},
        base_from_camera=mount.base_from_camera,
        ground_m=ground_below(vehicle),
        front_m=front - float(mount.base_from_camera.translation[0]),
        half_width_m=max(abs(wheel.position_m[1]) + wheel.width_m / 2 for wheel in wheels),
        wheel_paths=np.concatenate(paths),
        wheel_half_m=max(wheel.width_m for wheel in wheels) / 2,
        length_m=float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()),
        speed_m_s=float(np.abs(table["command_speed_m_s"]).max()),
        surveyed=suite.trace.world.height_at if suite.options.onboard.ground == "surveyed" else None,
    )


def _cases(
    folder: Path, suite: CameraSuite, onboard: OnboardDetector | None
) -> Iterator[tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]]:
    """Yield setting, truth and boxes: the truth of each Sun, then the visible labels and detections of each set."""
    for sun in suite.suns:
        truth = tables.read_parquet(folder / FRONT / f"{sun}_truth.parquet", TRUTH_COLUMNS)
        labels = truth[truth["kind"] == ROCK].assign(confidence=1.0)[list(DETECTION_COLUMNS)]
        yield {"sun": sun, "model": "", "exposure_ms": 0.0, "source": TRUTH}, truth, labels
        for model, exposure in suite.options.pictures:
            pictures = picture_folder(folder, FRONT, sun, model, exposure)
            row = {"sun": sun, "model": model, "exposure_ms": float(exposure)}
            yield row | {"source": VISIBLE}, truth, _visible(labels, pictures)
            if onboard is not None:
                detections = tables.read_parquet(pictures / "detections.parquet", DETECTION_COLUMNS)
                yield row | {"source": DETECTOR}, truth, detections


def _visible(labels: pd.DataFrame, pictures: Path) -> pd.DataFrame:
    """Return the labels that are visible in a set of pictures."""
    kept = []
    for frame, rows in labels.groupby("frame"):
        (path,) = frame_files(pictures, [int(str(frame))])
        eight = tone.to_8_bits(png.read_png(path))
        kept.append(rows[boxes_with_contrast(eight, rows[BOX].to_numpy(float))])
    return pd.concat(kept) if kept else labels

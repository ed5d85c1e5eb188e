"""What a detector's detections on a drive are worth, as tables.

Below a drive's folder, in `onboard/`: `sightings`, `stable`, `map` and `stops`. Their column `source` is `detector`, or
`truth`: the labels in the place of detections, or `visible`: of these the ones that stand out in the picture, which is
the most that any detector could reach: of what lies in the rover's own shadow a picture shows nothing.
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
from polarsim.rover.cameras.layout import BOX, DETECTION_COLUMNS, TRUTH_COLUMNS, picture_folder, require_pictures
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.perception import hazard_map, sightings
from polarsim.rover.perception.contrast import shows
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.perception.sightings import FrontCameraDrive
from polarsim.rover.vehicle.mounts import FRONT
from polarsim.rover.vehicle.table import Vehicle

TABLES = ("sightings", "stable", "map", "stops")
SETTING = ["seed", "sun", "model", "exposure_ms", "source"]  # what a metric is of
DETECTOR, TRUTH, VISIBLE = "detector", "truth", "visible"


def measure_drive(
    folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, onboard: OnboardDetector | None, seed: int
) -> dict[str, pd.DataFrame]:
    """Write the tables of a drive and return them by name.

    Raises
    ------
    PolarsimError
        The pictures' labels, or a detector's detections that are asked for, are missing.
    """
    suite = CameraSuite(read_trace(folder), vehicle, options, seed=seed)
    ride = ride_of(suite)
    world, confidence = suite.trace.world, options.onboard.confidence
    grid = hazard_map.grid_over(world)
    true = hazard_map.true_map(world, grid)
    found: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
    for row, truth, boxes in _cases(folder, suite, onboard):
        seen = sightings.sightings(truth, boxes, confidence)
        stable = sightings.first_stable(seen, ride.frames)
        gaps = {
            f"miss_{round(100 * height)}_cm_m": sightings.miss_distance(stable, world.rocks, ride, height)
            for height in sightings.HEIGHTS_M
        }
        stops = {"stops": sightings.false_stops(truth, boxes, ride, confidence), "length_m": ride.length_m, **gaps}
        seen_map = hazard_map.mapped(boxes, ride, grid, confidence)
        for name, table in (
            ("sightings", seen),
            ("stable", stable.assign(stopping_m=ride.stopping_m)),
            ("map", hazard_map.compared(seen_map, true)),
            ("stops", pd.DataFrame([stops])),
        ):
            found[name].append(table.assign(seed=seed, **row)[[*SETTING, *table.columns]])
    joined = {name: pd.concat(parts, ignore_index=True) for name, parts in found.items()}
    for name, table in joined.items():
        tables.write_parquet(folder / "onboard" / f"{name}.parquet", table)
    return joined


def ride_of(suite: CameraSuite) -> FrontCameraDrive:
    """Return the front camera's drive for the metrics."""
    mount, vehicle, table = suite.mounts[FRONT], suite.vehicle, suite.trace.table
    wheels = vehicle.wheels
    paths = [table[[f"{wheel.code}_x_m", f"{wheel.code}_y_m"]].to_numpy() for wheel in wheels]
    way = table[["x_m", "y_m"]].to_numpy()
    front = max(wheel.position_m[0] + wheel.radius_m + wheel.grouser_height_m for wheel in wheels)
    return FrontCameraDrive(
        frames=suite.frames,
        cameras={frame: suite.camera(FRONT, frame) for frame in suite.frames},
        base_from_camera=mount.base_from_camera,
        ground_m=float(np.mean([wheel.position_m[2] - wheel.radius_m for wheel in wheels])),
        front_m=front - float(mount.base_from_camera.translation[0]),
        half_width_m=max(abs(wheel.position_m[1]) + wheel.width_m / 2 for wheel in wheels),
        wheel_paths=np.concatenate(paths),
        wheel_half_m=max(wheel.width_m for wheel in wheels) / 2,
        length_m=float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()),
        speed_m_s=float(np.abs(table["command_speed_m_s"]).max()),
        surveyed=suite.trace.world.height_at if suite.options.onboard.ground == "surveyed" else None,
    )


def _cases(
    folder: Path, suite: CameraSuite, onboard: OnboardDetector | None
) -> Iterator[tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]]:
    """Setting, truth and boxes: of each Sun the truth itself, then what each set shows of it and the detector found."""
    for sun in suite.suns:
        truth = tables.read_parquet(folder / FRONT / f"{sun}_truth.parquet", TRUTH_COLUMNS)
        labels = truth[truth["kind"] == ROCK].assign(confidence=1.0)[list(DETECTION_COLUMNS)]
        yield {"sun": sun, "model": "", "exposure_ms": 0.0, "source": TRUTH}, truth, labels
        for model, exposure in suite.options.pictures:
            pictures = picture_folder(folder, FRONT, sun, model, exposure)
            row = {"sun": sun, "model": model, "exposure_ms": float(exposure)}
            yield row | {"source": VISIBLE}, truth, _visible(labels, pictures)
            if onboard is not None:
                found = tables.read_parquet(pictures / "detections.parquet", DETECTION_COLUMNS)
                yield row | {"source": DETECTOR}, truth, found


def _visible(labels: pd.DataFrame, pictures: Path) -> pd.DataFrame:
    """The labels that a set of pictures shows."""
    kept = []
    for frame, own in labels.groupby("frame"):
        path = pictures / f"{frame:05d}.png"
        require_pictures([path])
        eight = tone.to_8_bits(png.read(path))
        kept.append(own[shows(eight, own[BOX].to_numpy(float))])
    return pd.concat(kept) if kept else labels

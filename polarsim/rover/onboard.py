"""A judge on board: what it finds in the front camera's pictures of a drive, and what that is worth, as tables.

Below a drive's folder: `front_end_cam/<Sun>_<model>_<exposure>/detections.parquet`, and in `onboard/` the tables
`sightings`, `stable`, `map` and `stops`. Their column `source` is `judge`, or `truth`: the labels in the place of
detections, the most that any judge could reach.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect import judges, tone
from polarsim.detect.parts import digest, write_in_parts
from polarsim.detect.predict import detect
from polarsim.digest import code_digest
from polarsim.errors import RoverError, about
from polarsim.formats import png, tables
from polarsim.formats.files import write_text
from polarsim.photo import BOX_CLASSES, ROCK, WIDTH
from polarsim.render.options import Model
from polarsim.rover import hazard_map, hazards
from polarsim.rover.frames import picture_folder
from polarsim.rover.hazards import BOX, Ride
from polarsim.rover.sight import Sight
from polarsim.rover.sight_options import FRONT, OnboardOptions, SightOptions
from polarsim.rover.trace import read_trace
from polarsim.rover.truth import TRUTH_COLUMNS
from polarsim.rover.vehicle import Vehicle

DETECTION_COLUMNS = ("frame", "kind", "confidence", *BOX)
TABLES = ("sightings", "stable", "map", "stops")
SETTING = ["seed", "sun", "model", "exposure_ms", "source"]  # what a figure is of
JUDGE, TRUTH = "judge", "truth"
_BATCH = 8
_PART = 25 * _BATCH


@dataclass(frozen=True)
class Setting:
    """One set of the front camera's pictures."""

    sun: str
    model: Model
    exposure_ms: float


def settings_of(sight: Sight) -> list[Setting]:
    """All sets of pictures."""
    options = sight.options
    return [
        Setting(sun, model, exposure)
        for sun in sight.suns
        for model in options.models
        for exposure in options.exposures_ms
    ]


def detect_drive(folder: Path, vehicle: Vehicle, options: SightOptions, seed: int, threads: int = 1) -> None:
    """Write what the judge finds in the front camera's pictures, set by set; sets that are there stay.

    Raises
    ------
    PolarsimError
        No judge is named, or it cannot be read; a picture is missing.
    """
    weights = options.onboard.weights
    if weights is None:
        raise RoverError("onboard: no weights of a judge are named")
    sight = Sight(read_trace(folder), vehicle, options, seed=seed)
    judge = judges.read_judge(weights)
    detector: judges.Detector | None = None
    for setting in settings_of(sight):
        pictures = picture_folder(folder, FRONT, setting.sun, setting.model, setting.exposure_ms)
        paths = {f"{frame:05d}": pictures / f"{frame:05d}.png" for frame in sight.frames}
        _require(paths.values())
        identity = digest([weights, *paths.values()], code_digest(__name__), options.onboard.detect.model_dump_json())
        note = pictures / "detections.txt"
        if (pictures / "detections.parquet").is_file() and _said(note) == identity:
            continue
        if detector is None:
            with about(weights):
                detector = judges.family(judge.model).load(judge, pictures, options.onboard.detect, threads)
        _write_detections(pictures, paths, detector, judge.imgsz, setting.exposure_ms, options.onboard, identity)
        write_text(note, identity)


def measure_drive(folder: Path, vehicle: Vehicle, options: SightOptions, seed: int) -> dict[str, pd.DataFrame]:
    """Write the tables of a drive and return them by name.

    Raises
    ------
    PolarsimError
        The pictures' labels, or a judge's detections that are asked for, are missing.
    """
    sight = Sight(read_trace(folder), vehicle, options, seed=seed)
    ride = ride_of(sight)
    world, own = sight.trace.world, options.onboard
    grid = hazard_map.grid_over(world, own)
    true = hazard_map.true_map(world, grid)
    found: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
    for row, truth, boxes in _cases(folder, sight):
        seen = hazards.sightings(truth, boxes, own)
        stable = hazards.first_stable(seen, ride.frames, own)
        gaps = {
            f"miss_{round(100 * height)}_cm_m": hazards.miss_distance(stable, world.rocks, ride, height)
            for height in own.heights_m
        }
        stops = {"stops": hazards.false_stops(truth, boxes, ride, own), "length_m": ride.length_m, **gaps}
        seen_map = hazard_map.mapped(boxes, ride, grid, own)
        for name, table in (
            ("sightings", seen),
            ("stable", stable.assign(stopping_m=ride.stopping_m(own))),
            ("map", hazard_map.compared(seen_map, true)),
            ("stops", pd.DataFrame([stops])),
        ):
            found[name].append(table.assign(seed=seed, **row)[[*SETTING, *table.columns]])
    joined = {name: pd.concat(parts, ignore_index=True) for name, parts in found.items()}
    for name, table in joined.items():
        tables.write_parquet(folder / "onboard" / f"{name}.parquet", table)
    return joined


def ride_of(sight: Sight) -> Ride:
    """What the figures need to know of a drive."""
    mount, vehicle, table = sight.mounts[FRONT], sight.vehicle, sight.trace.table
    wheels = vehicle.wheels
    paths = [table[[f"{wheel.code}_x_m", f"{wheel.code}_y_m"]].to_numpy() for wheel in wheels]
    way = table[["x_m", "y_m"]].to_numpy()
    front = max(wheel.position_m[0] + wheel.radius_m + wheel.grouser_height_m for wheel in wheels)
    return Ride(
        frames=sight.frames,
        cameras={frame: sight.camera(FRONT, frame)[0] for frame in sight.frames},
        base_from_camera=mount.base_from_camera,
        lens=mount.lens,
        ground_m=float(np.mean([wheel.position_m[2] - wheel.radius_m for wheel in wheels])),
        front_m=front - float(mount.base_from_camera.translation[0]),
        half_width_m=max(abs(wheel.position_m[1]) + wheel.width_m / 2 for wheel in wheels),
        wheel_paths=np.concatenate(paths),
        wheel_half_m=max(wheel.width_m for wheel in wheels) / 2,
        length_m=float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()),
        speed_m_s=float(np.abs(table["command_speed_m_s"]).max()),
        surveyed=sight.trace.world.height_at if sight.options.onboard.ground == "surveyed" else None,
    )


def _cases(folder: Path, sight: Sight) -> Iterator[tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]]:
    """Setting, truth and boxes: of each Sun the truth itself, then what the judge found in each set of pictures."""
    for sun in sight.suns:
        truth = tables.read_parquet(folder / FRONT / f"{sun}_truth.parquet", TRUTH_COLUMNS)
        labels = truth[truth["kind"] == ROCK].assign(confidence=1.0)[list(DETECTION_COLUMNS)]
        yield {"sun": sun, "model": "", "exposure_ms": 0.0, "source": TRUTH}, truth, labels
        if sight.options.onboard.weights is None:
            continue
        for model in sight.options.models:
            for exposure in sight.options.exposures_ms:
                path = picture_folder(folder, FRONT, sun, model, exposure) / "detections.parquet"
                row = {"sun": sun, "model": model, "exposure_ms": float(exposure), "source": JUDGE}
                yield row, truth, tables.read_parquet(path, DETECTION_COLUMNS)


def _write_detections(
    pictures: Path,
    paths: dict[str, Path],
    detector: judges.Detector,
    imgsz: int,
    exposure_ms: float,
    options: OnboardOptions,
    identity: str,
) -> None:
    def see(names: Sequence[str]) -> pd.DataFrame:
        rows: list[tuple[Any, ...]] = []
        for group in (names[n : n + _BATCH] for n in range(0, len(names), _BATCH)):
            grey = [png.read(paths[name]) for name in group]
            eights = [tone.to_8_bits(tone.shrink(each, imgsz), options.detect, exposure_ms) for each in grey]
            scale = grey[0].shape[1] / WIDTH  # judges tell boxes in pixels of a full photo
            for name, result in zip(group, detect(detector, eights, imgsz), strict=True):
                rows += [(int(name), BOX_CLASSES[int(r[5])], r[4], *(scale * r[:4])) for r in result]
        return detection_table(rows)

    write_in_parts(pictures / "detections.parquet", list(paths), see, _PART, identity)


def detection_table(rows: list[tuple[Any, ...]]) -> pd.DataFrame:
    """Typed, rounded and in order: by frame and kind, the surest first."""
    table = pd.DataFrame(rows, columns=list(DETECTION_COLUMNS))
    table["frame"], table["kind"] = table["frame"].astype("int64"), table["kind"].astype("str")
    table["confidence"] = table["confidence"].astype("float64").round(5)
    for name in BOX:
        table[name] = table[name].astype("float64").round(2)
    order = [True, True, False, *[True] * 4]
    return table.sort_values(list(DETECTION_COLUMNS), ascending=order, kind="stable", ignore_index=True)


def _require(paths: Any) -> None:
    for path in paths:
        if not path.is_file():
            raise RoverError("the picture is missing", path=path)


def _said(note: Path) -> str:
    return note.read_text(encoding="utf-8") if note.is_file() else ""

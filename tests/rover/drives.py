"""Small synthetic drive for tests of exports: trace, pictures, labels and detections."""

from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from polarsim.formats import obj, png, tables
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.meshes import Mesh
from polarsim.rover.cameras.frames import pose_table
from polarsim.rover.cameras.layout import TRUTH_COLUMNS
from polarsim.rover.drive.trace import COLUMNS, LevelChanges, Trace, trace_table, write_trace
from polarsim.rover.export.replay import write_estimates
from polarsim.rover.export.sequence import write_sensors
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.vehicle.table import WHEELS, Vehicle
from polarsim.rover.world.practice import PracticeGround, practice_world
from polarsim.rover.world.surface import bare_world

DEMO = Path(__file__).parents[2] / "config/config.yaml"
SMALL = {
    "run": True,
    "world": {"terrains": [3], "margin_m": 2.0, "width_m": 3.0},
    "soil": {"slip_sinkage": False},
    "drive": {"picture_hz": 1, "longest_s": 5, "spread": 0},
    "cameras": {
        "views": ["front_end_cam"],
        "suns": ["3"],
        "models": ["hapke"],
        "exposures_ms": [256],
        "scale": 0.125,
        "stars": "none",
    },
    "bag": {"sun": "3", "height_hz": 0.2},
}
RADIUS, SPEED = 0.275, 0.2
SUMMARY = {"ended": "finished", "options": {"soil": {"gravity_m_s2": 1.62}}}  # of drive.json


def column(name: str) -> int:
    return COLUMNS.index(name)


def straight_drive(seconds: float = 2.0, log_hz: float = 100.0, picture_hz: float = 5.0) -> Trace:
    """Return a drive to the west at 0.2 m/s from x = 1 m on level ground; at each picture time a cell sinks by 1 mm."""
    times = np.arange(round(seconds * log_hz) + 1) / log_hz
    rows = np.zeros((len(times), len(COLUMNS)))
    rows[:, column("time_s")] = times
    rows[:, column("x_m")] = 1.0 - SPEED * times
    rows[:, column("z_m")] = RADIUS
    rows[:, column("qz")] = 1.0  # rotated by 180 degrees about z
    rows[:, column("vx_m_s")] = -SPEED
    rows[:, column("az_m_s2")] = 1.62
    for number, code in enumerate(WHEELS):
        rows[:, column(f"{code}_spin_rad")] = SPEED * times / RADIUS
        rows[:, column(f"{code}_spin_rad_s")] = SPEED / RADIUS
        rows[:, column(f"{code}_lift_m")] = 0.01 * times
        rows[:, column(f"{code}_qw")] = 1.0
        rows[:, column(f"{code}_slip")] = 0.01 * (number + 1)
        rows[:, column(f"{code}_load_n")] = 174.0
        rows[:, column(f"{code}_contact")] = number
    shots = np.arange(0, seconds + 1e-9, 1 / picture_hz)
    tracks = LevelChanges(
        shots, np.arange(len(shots) + 1), np.arange(len(shots), dtype=np.int32), np.full(len(shots), -1e-3, np.float32)
    )
    return Trace(trace_table(rows), bare_world(np.zeros((41, 81)), 0.05, -2.0, -1.0), tracks, dict(SUMMARY))


def write_drive(
    folder: Path, vehicle: Vehicle, views: tuple[str, ...] = ("front_end_cam",), scale: float = 1 / 16
) -> Trace:
    """Write a drive, and pictures of some views with a rock in each picture and a detection in every second."""
    trace = straight_drive()
    write_trace(folder, trace)
    write_sensors(folder, trace, vehicle, views, scale, seed=0)
    write_estimates(folder, trace, vehicle, (), seed=0)
    frames = range(0, len(trace.tracks.time), 2)
    for view in views:
        mount = mount_of(vehicle.camera(view), scale)
        cameras = {}
        for frame in frames:
            cameras[frame] = mount.at(trace.pose_at(float(trace.tracks.time[frame]))).world_from_camera
            pixels = np.full((mount.lens.height, mount.lens.width), 16 + frame, np.uint16)
            png.write_png(folder / view / "1_hapke_0256" / f"{frame:05d}.png", pixels)
        tables.write_parquet(folder / view / "poses.parquet", pose_table(cameras, trace.tracks.time))
        labels = pd.DataFrame(
            [(f, float(trace.tracks.time[f]), "rock", 7, 10.0, 20.0, 30.0, 50.0, 500, 3.0, 0.1) for f in frames],
            columns=list(TRUTH_COLUMNS),
        )
        tables.write_parquet(folder / view / "1_truth.parquet", labels)
        detections = labels.iloc[::2].drop(columns=["rock", "pixels", "distance_m", "height_m"]).assign(confidence=0.75)
        tables.write_parquet(folder / view / "1_hapke_0256/detections.parquet", detections)
    return trace


def configured(**rover) -> dict:
    return yaml.safe_load(DEMO.read_text()) | {"rover": rover}


def write_meshes(folder: Path, terrain: int) -> None:
    """Write a sandbox of 4 x 4 m with three rocks, as the meshes of a run."""
    world = practice_world(PracticeGround(length_m=4.0, width_m=4.0, cell_m=0.1, rocks=3, largest_m=0.1), 1)
    centre = np.array([2.0, 0.0, 0.0])
    x, y = np.meshgrid(world.x, world.y)
    ground = grid_mesh(x, y, world.level)
    obj.write_obj(folder / obj.ground_name(terrain), Mesh(ground.vertices - centre, ground.faces), "ground")
    for rock in world.rocks["rock"]:
        vertices, triangles = world.rock_mesh(int(rock))
        name = obj.rock_name(terrain, int(rock) + 1)
        obj.write_obj(folder / name, Mesh(vertices - centre, triangles), f"rock{rock + 1}")

"""Inputs of a drive (world, rover, soil, options) and the path, steering law and start computed from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from polarsim.photo import terrain_text
from polarsim.randomness import generator
from polarsim.rover.drive.control import ReferencePath, Steering, SteeringLaw
from polarsim.rover.drive.options import DriveOptions, Point
from polarsim.rover.drive.state import EDGE_MARGIN_M, OffGridError, Start
from polarsim.rover.soil.law import Soil, read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import Vehicle, read_vehicle
from polarsim.rover.world.dem import dem_world
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.rock_parts import RockPart, read_rock_parts, rock_parts, write_rock_parts
from polarsim.rover.world.stitch import read_terrain_meshes, rough_world, stitch
from polarsim.rover.world.surface import World

P_ONLY_GAIN_RAD_M = 1.0472  # steering angle per offset for control by offset only, as in the paper
# Steering angle per offset, per offset integrated over progress, and per heading error: the rover returns to the path
# within a few metres and without oscillation.
GAIN_RAD_M, INTEGRAL_RAD_M2, HEADING_GAIN = 4.0, 4.0, 2.0
STEER_LIMIT_DEG = 30.0  # maximum steering angle of a wheel in both directions
# Differences between seeds at `spread` 1: uniform within these bounds for starts, normally distributed for heights.
ALONG_M, OFFSET_M, HEADING_DEG, GROUND_SD_M = 0.10, 0.02, 1.0, 0.0005
LOG_HZ = 100.0  # rows of a trace per second
AHEAD_M = 3.0  # from the start of an autonomous drive to the first terrain, and from the last terrain to the end
BEHIND_M = 1.5  # ground behind the rover's centre at the start, for the rear wheels and a margin
SAMPLE = 0.1  # m between points of the path at which the wheel positions are checked


@dataclass(frozen=True)
class DriveJob:
    """All inputs of a drive."""

    world: World
    vehicle: Vehicle
    soil: Soil
    drive: DriveOptions
    soil_options: SoilOptions
    world_options: WorldOptions
    seed: int
    log_hz: float = LOG_HZ
    rock_parts: Sequence[RockPart] | None = None  # None: the simulation cuts the rocks

    @cached_property
    def route(self) -> ReferencePath:
        """Path of the drive, see `path_of`."""
        return ReferencePath(np.array(path_of(self.world_options, self.drive), float))

    @property
    def start(self) -> Start:
        """The path's first point, displaced and rotated by the seed."""
        heading = float(self.route.headings[0])
        bounds = self.drive.spread * np.array([ALONG_M, OFFSET_M, math.radians(HEADING_DEG)])
        along, offset, angle = generator(self.seed, "rover", "start").uniform(-1, 1, 3) * bounds
        x, y = self.route.points[0] + along * np.array([math.cos(heading), math.sin(heading)])
        x, y = x - offset * math.sin(heading), y + offset * math.cos(heading)
        return Start(float(x), float(y), heading + float(angle))

    @property
    def law(self) -> SteeringLaw:
        """Steering along the path."""
        speed, limit = self.drive.speed_m_s, math.radians(STEER_LIMIT_DEG)
        if self.drive.control == "P-only":
            steering: Steering = "crab" if self.drive.steering == "crab" else "ackermann"
            return SteeringLaw(speed, P_ONLY_GAIN_RAD_M, 0.0, limit, steering)
        return SteeringLaw(speed, GAIN_RAD_M, HEADING_GAIN, limit, self.drive.steering, INTEGRAL_RAD_M2)


def job_of(
    *, meshes: Path, world: WorldOptions, soil: SoilOptions, drive: DriveOptions, seed: int, parts: Path | None = None
) -> DriveJob:
    """Return the drive that the options describe, over meshes of a run (`meshes/` or `repaired/TerrainNN/`).

    `parts` is a file of `cut_rocks` for the same meshes and options.
    """
    ground = rough_world(_smooth_world(meshes, world, drive), drive.spread * GROUND_SD_M, seed)
    cut = read_rock_parts(parts, ground) if parts else None
    vehicle, measured = read_vehicle(drive.vehicle), read_soil(soil.table, soil.soil)
    return DriveJob(ground, vehicle, measured, drive, soil, world, seed, rock_parts=cut)


def cut_rocks(
    *, meshes: Path, parts: Path, world: WorldOptions, drive: DriveOptions, autonomous_width_m: float | None
) -> None:
    """Write the convex parts of the rocks of all drives along a path, or of all autonomous drives if they have a width.

    The rocks do not depend on the seed.
    """
    if autonomous_width_m is not None:
        world, drive = widened(world, drive, autonomous_width_m)
    ground = _smooth_world(meshes, world, drive)
    write_rock_parts(parts, rock_parts(ground), ground)


def _smooth_world(meshes: Path, world: WorldOptions, drive: DriveOptions) -> World:
    """Return the world without the noise of a seed."""
    terrains = [read_terrain_meshes(meshes / f"Terrain{terrain_text(name)}", name) for name in world.terrains]
    return dem_world(world, terrains, np.array(path_of(world, drive))) if world.dem else stitch(terrains, world)


def widened(world: WorldOptions, drive: DriveOptions, width_m: float) -> tuple[WorldOptions, DriveOptions]:
    """Return the options of an autonomous drive: its straight line, and ground before, behind and at its sides."""
    # The grid of an elevation model surrounds the path, that of a strip surrounds the terrains.
    room = {"width_m": width_m, "margin_m": BEHIND_M + (0.0 if world.dem else AHEAD_M)}
    return world.model_copy(update=room), drive.model_copy(update={"path_m": straight_line(world, drive)})


def straight_line(world: WorldOptions, drive: DriveOptions) -> tuple[Point, Point]:
    """Return the line of an autonomous drive, from the path's first point to the last."""
    points = path_of(world, drive, AHEAD_M)
    return points[0], points[-1]


def path_of(world: WorldOptions, drive: DriveOptions, beyond_m: float = 0.0) -> tuple[Point, ...]:
    """Return the points of the path; by default the centre line from east to west.

    The default path extends `beyond_m` outside the terrains on both sides.
    """
    half = world.half_length_m + beyond_m
    return drive.path_m or ((half, 0.0), (-half, 0.0))


def require_on_grid(job: DriveJob) -> None:
    """Raise `OffGridError` with the position at which a wheel would leave the grid along the path."""
    world, wheels, route = job.world, job.vehicle.wheels, job.route
    reach = max(wheel.outer_radius_m for wheel in wheels) + wheels[0].width_m / 2 + EDGE_MARGIN_M
    low, high = (world.x[0] + reach, world.y[0] + reach), (world.x[-1] - reach, world.y[-1] - reach)
    centres = job.vehicle.wheel_centres[:, :2]
    for begin, heading, length in zip(route.points, route.headings, route.lengths, strict=False):
        step = np.array([math.cos(heading), math.sin(heading)])
        rotated = centres @ np.array([[step[0], step[1]], [-step[1], step[0]]])
        for along in (*np.arange(0.0, length, SAMPLE), length):
            points = begin + along * step + rotated
            if not ((points >= low) & (points <= high)).all():
                x, y = begin + along * step
                raise OffGridError(
                    f"the path leaves the ground at ({x:.2f}, {y:.2f}) m: wheels may go from x {low[0]:.2f} to "
                    f"{high[0]:.2f} m and from y {low[1]:.2f} to {high[1]:.2f} m"
                )

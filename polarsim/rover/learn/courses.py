"""Courses: for each seed a world and a straight line from the start to the goal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

from polarsim.rover.drive.job import GROUND_SD_M, DriveJob
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.planning.drive import autonomous_job, job_for
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import Vehicle, read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.practice import PracticeGround, practice_world
from polarsim.rover.world.stitch import rough_world
from polarsim.rover.world.surface import World

_MARGIN_M = 2.0  # from the ends of the world to start and goal
DRIVE, SOIL, STRIP, AUTONOMY_DEFAULTS = DriveOptions(), SoilOptions(), WorldOptions(), AutonomyOptions()
# The camera sees ground from 2.2 m ahead on; no rock is closer to the start.
PRACTICE_GROUND = PracticeGround(length_m=12.0, width_m=8.0, rocks=40, smallest_m=0.15, largest_m=0.4, clear_m=2.5)


class Course(Protocol):
    """World, rover and line of an episode."""

    @property
    def vehicle(self) -> Vehicle:
        """Rover of the course."""
        ...

    def job(self, seed: int) -> DriveJob:
        """Return world, rover, soil and straight line of a seed."""
        ...


class _VehicleCourse:
    """Course with the vehicle of the drive options, read once."""

    drive: DriveOptions

    @cached_property
    def vehicle(self) -> Vehicle:
        return read_vehicle(self.drive.vehicle)


@dataclass(frozen=True)
class PracticeCourse(_VehicleCourse):
    """Random practice ground for each seed, driven from east to west."""

    ground: PracticeGround = PRACTICE_GROUND
    drive: DriveOptions = DRIVE
    soil: SoilOptions = SOIL

    def job(self, seed: int) -> DriveJob:
        return _along(practice_world(self.ground, seed), self.vehicle, self.drive, self.soil, seed)


@dataclass(frozen=True)
class WorldCourse(_VehicleCourse):
    """The same world for all seeds; starts differ."""

    world: World
    drive: DriveOptions = DRIVE
    soil: SoilOptions = SOIL

    def job(self, seed: int) -> DriveJob:
        return _along(self.world, self.vehicle, self.drive, self.soil, seed)


@dataclass(frozen=True)
class TerrainCourse(_VehicleCourse):
    """Terrains of a run side by side, as in autonomous drives (`meshes/TerrainNN/`); seeds change the ground's noise.

    Raises (with the first job)
    ------
    PolarsimError
        Meshes are missing or broken.
    """

    meshes: Path
    world: WorldOptions = STRIP
    drive: DriveOptions = DRIVE
    soil: SoilOptions = SOIL
    options: AutonomyOptions = AUTONOMY_DEFAULTS

    def job(self, seed: int) -> DriveJob:
        world = rough_world(self._bare.world, self.drive.spread * GROUND_SD_M, seed)
        drive = self._bare.drive.model_copy(update={"spread": self.drive.spread})
        return replace(self._bare, world=world, drive=drive, seed=seed)

    @cached_property
    def _bare(self) -> DriveJob:
        """Job without noise of the ground; meshes are read once."""
        drive = self.drive.model_copy(update={"spread": 0.0})
        job = job_for(meshes=self.meshes, world=self.world, soil=self.soil, drive=drive, options=self.options, seed=0)
        return autonomous_job(job, self.options)


def _along(world: World, vehicle: Vehicle, drive: DriveOptions, soil: SoilOptions, seed: int) -> DriveJob:
    """Return a job along the centre of a world from east to west, or along the path of the drive options."""
    y = float(world.y.mean())
    line = drive.path_m or ((float(world.x[-1]) - _MARGIN_M, y), (float(world.x[0]) + _MARGIN_M, y))
    drive = drive.model_copy(update={"path_m": (line[0], line[-1])})
    return DriveJob(world, vehicle, read_soil(soil.table, soil.soil), drive, soil, WorldOptions(), seed)

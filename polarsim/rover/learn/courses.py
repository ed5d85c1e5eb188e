"""Courses: a world anew for every seed, and the straight line over it from the start to the goal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

from polarsim.rover.drive.job import GROUND_SD_M, Job
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

_MARGIN_M = 2.0  # from the world's ends to start and goal
DRIVE, SOIL, STRIP, LOOKS = DriveOptions(), SoilOptions(), WorldOptions(), AutonomyOptions()
# Its camera first sees ground 2.2 m ahead: no rock lies nearer to the start.
MADE_UP = PracticeGround(length_m=12.0, width_m=8.0, rocks=40, smallest_m=0.15, largest_m=0.4, clear_m=2.5)


class Course(Protocol):
    """Where episodes take place."""

    @property
    def vehicle(self) -> Vehicle:
        """The rover that drives there."""
        ...

    def job(self, seed: int) -> Job:
        """World, rover, soil and straight line of a seed."""
        ...


class _Driven:
    """A course by the options of a drive, which name the rover: it is read once."""

    drive: DriveOptions

    @cached_property
    def vehicle(self) -> Vehicle:
        return read_vehicle(self.drive.vehicle)


@dataclass(frozen=True)
class MadeUpCourse(_Driven):
    """A practice ground for every seed, from the east to the west."""

    ground: PracticeGround = MADE_UP
    drive: DriveOptions = DRIVE
    soil: SoilOptions = SOIL

    def job(self, seed: int) -> Job:
        return _along(practice_world(self.ground, seed), self.vehicle, self.drive, self.soil, seed)


@dataclass(frozen=True)
class WorldCourse(_Driven):
    """The same world for every seed: its starts differ."""

    world: World
    drive: DriveOptions = DRIVE
    soil: SoilOptions = SOIL

    def job(self, seed: int) -> Job:
        return _along(self.world, self.vehicle, self.drive, self.soil, seed)


@dataclass(frozen=True)
class TerrainCourse(_Driven):
    """A run's terrains side by side, as drives have them that decide (`meshes/TerrainNN/`); grounds differ by noise.

    Raises (with the first job)
    ------
    PolarsimError
        Meshes are missing or broken.
    """

    meshes: Path
    world: WorldOptions = STRIP
    drive: DriveOptions = DRIVE
    soil: SoilOptions = SOIL
    options: AutonomyOptions = LOOKS

    def job(self, seed: int) -> Job:
        world = rough_world(self._bare.world, self.drive.spread * GROUND_SD_M, seed)
        drive = self._bare.drive.model_copy(update={"spread": self.drive.spread})
        return replace(self._bare, world=world, drive=drive, seed=seed)

    @cached_property
    def _bare(self) -> Job:
        """The job without noise on its ground: meshes are read once."""
        drive = self.drive.model_copy(update={"spread": 0.0})
        job = job_for(meshes=self.meshes, world=self.world, soil=self.soil, drive=drive, options=self.options, seed=0)
        return autonomous_job(job, self.options)


def _along(world: World, vehicle: Vehicle, drive: DriveOptions, soil: SoilOptions, seed: int) -> Job:
    """Along the centre of a world from the east to the west, unless the drive's options have a path."""
    y = float(world.y.mean())
    line = drive.path_m or ((float(world.x[-1]) - _MARGIN_M, y), (float(world.x[0]) + _MARGIN_M, y))
    drive = drive.model_copy(update={"path_m": (line[0], line[-1])})
    return Job(world, vehicle, read_soil(soil.table, soil.soil), drive, soil, WorldOptions(), seed)

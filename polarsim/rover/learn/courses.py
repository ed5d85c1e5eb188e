"""Courses: for each seed a world and a straight line from the start to the goal."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

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
# The camera sees ground from 2.2 m ahead on; no rock is closer to the start.
PRACTICE_GROUND = PracticeGround(length_m=12.0, width_m=8.0, rocks=40, smallest_m=0.15, largest_m=0.4, clear_m=2.5)


@dataclass(frozen=True, kw_only=True)
class Course(ABC):
    """World, rover and line of the episodes; by default the line is the centre of the world from east to west."""

    drive: DriveOptions = field(default_factory=DriveOptions)
    soil: SoilOptions = field(default_factory=SoilOptions)

    @abstractmethod
    def job(self, seed: int) -> DriveJob:
        """Return world, rover, soil and straight line of a seed."""

    @cached_property
    def vehicle(self) -> Vehicle:
        """Rover of the course."""
        return read_vehicle(self.drive.vehicle)

    def _along(self, world: World, seed: int) -> DriveJob:
        y = float(world.y.mean())
        line = self.drive.path_m or ((float(world.x[-1]) - _MARGIN_M, y), (float(world.x[0]) + _MARGIN_M, y))
        drive = self.drive.model_copy(update={"path_m": (line[0], line[-1])})
        soil = read_soil(self.soil.table, self.soil.soil)
        return DriveJob(world, self.vehicle, soil, drive, self.soil, WorldOptions(), seed)


@dataclass(frozen=True)
class PracticeCourse(Course):
    """Random practice ground for each seed."""

    ground: PracticeGround = PRACTICE_GROUND

    def job(self, seed: int) -> DriveJob:
        return self._along(practice_world(self.ground, seed), seed)


@dataclass(frozen=True)
class WorldCourse(Course):
    """The same world for all seeds; starts differ."""

    world: World

    def job(self, seed: int) -> DriveJob:
        return self._along(self.world, seed)


@dataclass(frozen=True)
class TerrainCourse(Course):
    """Terrains of a run side by side, as in autonomous drives (`meshes/` or `repaired/`); seeds change ground noise."""

    meshes: Path
    world: WorldOptions = field(default_factory=WorldOptions)

    def job(self, seed: int) -> DriveJob:
        world = rough_world(self._bare.world, self.drive.spread * GROUND_SD_M, seed)
        drive = self._bare.drive.model_copy(update={"spread": self.drive.spread})
        return replace(self._bare, world=world, drive=drive, seed=seed)

    @cached_property
    def _bare(self) -> DriveJob:
        """Job without noise of the ground; meshes are read once."""
        drive, options = self.drive.model_copy(update={"spread": 0.0}), AutonomyOptions()
        job = job_for(meshes=self.meshes, world=self.world, soil=self.soil, drive=drive, options=options, seed=0)
        return autonomous_job(job, options)

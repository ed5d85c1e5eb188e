"""A small synthetic terrain (wavy sand, two closed rocks, two tripods) and the files of the stages."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj
from polarsim.formats.files import write_json
from polarsim.formats.tables import write_parquet
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.run_files.rigs import LocalisedRig, write_localised
from tests.support.polar_rig import default_rig

TERRAIN = 3
SUN_LAMPS = {"30": (3.6, 1.4, 0.8), "180": (-3.2, 1.8, 0.8), "270": (-1.6, -3.4, 0.8), "350": (3.4, 0.8, 0.8)}
ROCKS = {1: ((0.5, 0.4), 0.2), 2: ((-0.6, -0.3), 0.06)}  # centre, side in metres


@dataclass(frozen=True)
class World:
    """Content of the true frame; `write` stores it in another frame."""

    terrain: int
    poses: dict[str, Pose]  # truth_from_left by position

    def write(
        self, folder: Path, other_from_truth: Pose | None = None, grown: float = 0.0, rocks: tuple[int, ...] = (1, 2)
    ) -> None:
        """Write cameras, meshes and rocks.parquet to a folder; rocks are enlarged by `grown` on all sides, metres."""
        other_from_truth = other_from_truth or Pose.identity()
        for position, pose in self.poses.items():
            localised = LocalisedRig(default_rig(), other_from_truth @ pose, "scans", {"rmse_mm": 1.5})
            write_localised(folder / "cameras" / f"Pos{position}.json", localised)
        suns = {azimuth: other_from_truth.apply(np.array(tripod)) for azimuth, tripod in SUN_LAMPS.items()}
        write_json(folder / "lamps.json", {azimuth: tripod.tolist() for azimuth, tripod in suns.items()})
        ground = make_sand()
        write_mesh(folder, obj.ground_name(TERRAIN), ground, other_from_truth)
        rows = []
        for rock in rocks:
            (x, y), side = ROCKS[rock]
            mesh = make_cube((x, y, side / 4), side + 2 * grown)
            write_mesh(folder, obj.rock_name(TERRAIN, rock), mesh, other_from_truth)
            centre = other_from_truth.apply(np.array([x, y, side / 4]))
            low, high = centre - side / 2, centre + side / 2
            names = ("rock", "x", "y", "z", "size_m", "height_m", "volume_m3", "x0", "y0", "z0", "x1", "y1", "z1")
            rows.append(dict(zip(names, (rock, *centre, side, 0.75 * side, 0.75 * side**3, *low, *high), strict=True)))
        columns = ["rock", "x", "y", "z", "size_m", "height_m", "volume_m3", "x0", "y0", "z0", "x1", "y1", "z1"]
        write_parquet(folder / "rocks.parquet", pd.DataFrame(rows, columns=columns))


@pytest.fixture
def world() -> World:
    poses = {
        "A": camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(25)),
        "C": camera_pose(np.array([0.8, -3.8, 1.5]), np.radians(103), np.radians(25)),
    }
    return World(TERRAIN, poses)


@pytest.fixture
def sun_lamps() -> dict[str, tuple[float, float, float]]:
    """Return lamp positions by azimuth, true frame."""
    return SUN_LAMPS


@pytest.fixture
def sand() -> Mesh:
    return make_sand()


@pytest.fixture
def cube() -> Callable[[tuple[float, float, float], float], Mesh]:
    return make_cube


def write_mesh(folder: Path, name: str, mesh: Mesh, other_from_truth: Pose) -> None:
    obj.write_obj(folder / "meshes" / name, Mesh(other_from_truth.apply(mesh.vertices), mesh.faces), name)


def make_sand(n: int = 81) -> Mesh:
    """Return a ground of 4 m x 4 m with waves of 3 cm, which constrains all directions of a registration."""
    x, y = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n), indexing="ij")
    z = 0.03 * np.sin(4 * x + 1) * np.cos(3 * y)
    number = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces)


def make_cube(centre: tuple[float, float, float], side: float) -> Mesh:
    """Return a closed cuboid of twelve triangles with outward normals."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * side / 2
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]
    return Mesh(corners + np.array(centre), np.array(faces))

"""Small scenes with ground truth: convex rocks on a smooth ground, scanned from two tripods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import rectified_left
from polarsim.geometry.topology import hull_faces
from polarsim.rocks.scans import ScanPoints, merge_scans, scan_in_sandbox
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scans import trusted_pixels
from tests.support.polar_rig import default_rig
from tests.support.scans import caster_of, range_map

TRIPODS = {
    "A": camera_pose(np.array([3.55, -0.35, 1.52]), np.radians(180), np.radians(25)),
    "C": camera_pose(np.array([0.70, -3.55, 1.50]), np.radians(104), np.radians(27)),
}
FULL_LENS = Lens(1990.6, 1990.6, 966.7, 600.6, width=1936, height=1216)  # of the rectified left grid


def flat(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.zeros_like(x + y)


def hilly(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return heights of a crater with a rim (slopes up to 15 degrees) and a long swell."""
    r = np.hypot(x + 0.4, y - 0.2)
    return 0.05 * np.exp(-(((r - 0.8) / 0.25) ** 2)) - 0.06 * np.exp(-((r / 0.5) ** 2)) + 0.03 * np.sin(1.5 * y)


def angular_rock(rng: np.random.Generator, centre: tuple[float, float, float], size: float) -> ConvexHull:
    """Return a convex polyhedron with a longest horizontal side of `size` metres."""
    points = rng.normal(size=(24, 3))
    points *= [0.5, 0.4, 0.35] / np.linalg.norm(points, axis=1, keepdims=True)
    points *= size / np.ptp(points[:, :2], axis=0).max()
    return ConvexHull(points + centre)


@dataclass
class Scene:
    """Ground z(x, y) and convex rocks that can be scanned."""

    ground: Callable[[np.ndarray, np.ndarray], np.ndarray] = flat
    rocks: list[ConvexHull] = field(default_factory=list)

    @cached_property
    def caster(self) -> Caster:
        x, y = np.meshgrid(*[np.linspace(-2, 2, 801)] * 2)
        rocks = [Mesh(rock.points, hull_faces(rock.points)) for rock in self.rocks]
        return caster_of([grid_mesh(x, y, self.ground(x, y)), *rocks])

    def range_map(self, sandbox_from_camera: Pose, lens: Lens, noise: float, rng: np.random.Generator) -> np.ndarray:
        """Return points (h, w, 3) float32 in the camera frame, with noise along the ray in metres; without walls."""
        return range_map(self.caster, sandbox_from_camera, lens, rng, noise).astype(np.float32)

    def scanned(self, rng: np.random.Generator, *, noise: float = 0.002, reduction: float = 0.5) -> ScanPoints:
        """Return the points of both tripods at a reduced resolution."""
        lens = FULL_LENS.scaled(reduction)
        scans = []
        for sandbox_from_camera in TRIPODS.values():
            seen = self.range_map(sandbox_from_camera, lens, noise, rng)
            scans.append(scan_in_sandbox(seen[trusted_pixels(seen, lens.fx)].astype(float), sandbox_from_camera))
        return merge_scans(scans)


SIZES = {(0.9, 0.6): 0.25, (-0.2, -0.9): 0.12, (1.1, -0.5): 0.08}  # position (x, y): longest side, metres


@pytest.fixture(scope="session")
def three_rocks() -> Scene:
    """Return rocks of 25, 12 and 8 cm on a hilly ground, each sunk by a third."""
    rng = np.random.default_rng(5)
    rocks = []
    for (x, y), size in SIZES.items():
        level = float(hilly(np.array(x), np.array(y)))
        rocks.append(angular_rock(rng, (x, y, level + 0.1 * size), size))
    return Scene(hilly, rocks)


@pytest.fixture(scope="session")
def three_rock_scans(three_rocks: Scene) -> ScanPoints:
    return three_rocks.scanned(np.random.default_rng(1))


@pytest.fixture(scope="session")
def bare_scans() -> ScanPoints:
    return Scene(hilly).scanned(np.random.default_rng(2))


@pytest.fixture(scope="session")
def tripods() -> dict[str, Pose]:
    """Poses of the rectified left cameras."""
    return TRIPODS


@pytest.fixture(scope="session")
def localised(tripods: dict[str, Pose]) -> dict[str, LocalisedRig]:
    """Return the stated rig with its rectified left cameras at the tripods."""
    rig = default_rig()
    left_from_rectified = rectified_left(rig).left_from_rectified
    return {name: LocalisedRig(rig, pose @ left_from_rectified.inverse(), "truth") for name, pose in tripods.items()}

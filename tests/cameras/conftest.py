"""Small scenes with known cameras: rocks with boxes, and a box of sand that can be scanned."""

from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest
import trimesh
from scipy.ndimage import gaussian_filter

from polarsim.cameras import scans as registration
from polarsim.cameras import search
from polarsim.geometry import boxes
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.geometry.topology import hull_faces, remove_unused_vertices
from tests.support.polar_rig import default_rig
from tests.support.scans import caster_of, range_map

SCALE = 0.25  # of the photos on whose grid scenes are scanned
TRUE_POSES = {  # decimetres and degrees off the survey, as real ones are
    "A": camera_pose(np.array([3.63, -0.40, 1.52]), np.radians(178.6), np.radians(25.2), np.radians(-0.6)),
    "B": camera_pose(np.array([6.15, -0.53, 1.57]), np.radians(178.4), np.radians(24.0), np.radians(1.1)),
    "C": camera_pose(np.array([0.86, -3.75, 1.56]), np.radians(103.9), np.radians(26.5), np.radians(1.3)),
}


def rock(rng: np.random.Generator, position: np.ndarray, size: float) -> Mesh:
    """Return a convex rock at a position (3,), about `size` metres long."""
    points = rng.standard_normal((60, 3))
    points *= size / 2 * rng.uniform(0.6, 1, 3) / np.linalg.norm(points, axis=1, keepdims=True)
    return remove_unused_vertices(points + position, hull_faces(points))


def rocks(rng: np.random.Generator, count: int) -> dict[int, Mesh]:
    """Return rocks with ids from 1 that do not touch."""
    points: list[np.ndarray] = []
    while len(points) < count:
        position = np.append(rng.uniform(-1.5, 1.5, 2), 0.0)
        if all(np.linalg.norm(position - other) > 0.4 for other in points):
            points.append(position)
    return {k: rock(rng, position, rng.uniform(0.08, 0.3)) for k, position in enumerate(points, 1)}


def annotated_boxes(
    meshes: dict[int, Mesh], rig: StereoRig, pose: Pose, rng: np.random.Generator, sd: float
) -> np.ndarray:
    """Return boxes (m, 4) as annotated by a person: edges off by `sd` px, whole pixels; NaN for rocks out of view."""
    made = []
    for mesh in meshes.values():
        box = boxes.box_around_points(rig.left.project(pose.inverse().apply(mesh.vertices)))
        cut = boxes.clip(box, rig.left.width, rig.left.height)
        seen = boxes.area(cut) > 0.5 * boxes.area(box)
        off = boxes.clip(cut + sd * rng.standard_normal(4), rig.left.width, rig.left.height)
        made.append(np.round(off) if seen else np.full(4, np.nan))
    return np.array(made)


@dataclass(frozen=True)
class Sandbox:
    """Sand with relief, rocks and walls, prepared for ray casts."""

    scene: Caster
    rig: StereoRig

    def scan(self, sandbox_from_left: Pose, rng: np.random.Generator, noise: float) -> np.ndarray:
        """Return a range map (h, w, 3) in the rectified left frame, metres, NaN without a hit."""
        grid = rectified_left(self.rig)
        return range_map(self.scene, sandbox_from_left @ grid.left_from_rectified, grid.lens, rng, noise)


def box(low: np.ndarray, high: np.ndarray) -> Mesh:
    solid = trimesh.creation.box(bounds=[low, high])
    return Mesh(np.asarray(solid.vertices), np.asarray(solid.faces))


def make_sandbox(seed: int) -> Sandbox:
    rng = np.random.default_rng(seed)
    side = 400
    x, y = np.meshgrid(*[np.linspace(-2, 2, side)] * 2)
    z = np.zeros((side, side))
    for width, height in ((16, 0.010), (6, 0.004)):
        bumps = gaussian_filter(rng.standard_normal((side, side)), width)
        z += height * bumps / bumps.std()
    meshes = [grid_mesh(x, y, z), *rocks(rng, 12).values(), box(np.array([-8, -8, -0.6]), np.array([8, 8, -0.5]))]
    for axis in (0, 1):
        for sign in (-1, 1):
            low, high = np.array([-2.05, -2.05, -0.5]), np.array([2.05, 2.05, 0.3])
            low[axis], high[axis] = sorted((2.0 * sign, 2.05 * sign))
            meshes.append(box(low, high))
    full = default_rig()
    return Sandbox(
        caster_of(meshes), StereoRig(full.left.scaled(SCALE), full.right.scaled(SCALE), full.left_from_right)
    )


def patched(module: ModuleType, **constants: float) -> Iterator[None]:
    """Replace constants of a module until the fixture ends."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in constants.items():
            patch.setattr(module, name, value)
        yield


@pytest.fixture(scope="module")
def coarse_search() -> Iterator[None]:
    """Search poses on a coarser grid and refine fewer hypotheses, to save time."""
    yield from patched(search, DISTANCE_STEP=0.6, HEIGHT_STEP=0.3, STARTS=5)


@pytest.fixture(scope="module")
def coarse_scans() -> Iterator[None]:
    """Thin scans more, and search their motion in larger steps, to save time."""
    yield from patched(registration, VOXEL=0.02, YAW_STEP_DEG=3.0, CANDIDATES=2, MAP_STEP=0.03)


@pytest.fixture(scope="session")
def sandbox() -> Sandbox:
    return make_sandbox(5)


@pytest.fixture(scope="session")
def range_maps(sandbox: Sandbox) -> dict[str, np.ndarray]:
    """Scans of A and C with 2 mm of noise."""
    rng = np.random.default_rng(6)
    return {position: sandbox.scan(TRUE_POSES[position], rng, 0.002) for position in "AC"}


@pytest.fixture(scope="session")
def scans(sandbox: Sandbox, range_maps: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert the range maps to points (n, 3) in the left camera frames."""
    left_from_rectified = rectified_left(sandbox.rig).left_from_rectified
    return {p: left_from_rectified.apply(m[np.isfinite(m).all(axis=-1)]) for p, m in range_maps.items()}


@pytest.fixture(scope="session")
def true_poses() -> dict[str, Pose]:
    return TRUE_POSES


@dataclass(frozen=True)
class LabelledRocks:
    """Rocks with ids, and their annotated boxes by position (NaN: out of view)."""

    meshes: dict[int, Mesh]
    boxes: dict[str, np.ndarray]

    def seen(self, position: str) -> np.ndarray:
        """Return the boxes (n, 4) of visible rocks."""
        return self.boxes[position][np.isfinite(self.boxes[position]).all(axis=1)]


@pytest.fixture(scope="session")
def labelled() -> LabelledRocks:
    """Fifteen rocks with annotated edges that are off by 2 px, as those of people."""
    rng = np.random.default_rng(11)
    meshes = rocks(rng, 15)
    return LabelledRocks(
        meshes, {p: annotated_boxes(meshes, default_rig(), TRUE_POSES[p], rng, 2.0) for p in TRUE_POSES}
    )

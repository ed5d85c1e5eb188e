"""Photos of a textured height field, by rays through every pixel."""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.photo import PhotoKey
from polarsim.relief.heights import HeightMap, PhotoView
from polarsim.rocks.folder import height_mesh
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.scans import Extent
from tests.support.polar_survey import SUN_LAMPS

GRID = FloorGrid(Extent(-0.7, -0.7, 0.7, 0.7), 0.01)
LARGER = FloorGrid(Extent(-1.6, -1.6, 1.6, 1.6), 0.01)
LENS = Lens(515.0, 515.0, 242.0, 152.0, width=484, height=304)
CENTRES = {"A": ((2.6, -0.2, 1.4), 180.0), "C": ((0.2, -2.6, 1.4), 90.0)}  # position and heading, degrees
NO_MESH = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))


def relief(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A mound of 3 cm and a hollow of 2 cm, 1 cm above the level of the start surface."""
    return (
        0.01
        + 0.03 * np.exp(-((x - 0.2) ** 2 + (y - 0.1) ** 2) / 0.03)
        - 0.02 * np.exp(-((x + 0.3) ** 2 + (y + 0.2) ** 2) / 0.02)
    )


def texture(seed: int) -> np.ndarray:
    """Return a pattern (rows, columns) on the cells of `LARGER`, 1 with a standard deviation of 0.2."""
    noise = np.random.default_rng(seed).normal(size=LARGER.shape)
    pattern = ndimage.gaussian_filter(noise, 1.2)
    return 1 + 0.2 * pattern / pattern.std()


def camera(position: str, side: str) -> Camera:
    """Return a camera towards the centre; left and right are 0.3 m apart."""
    centre, heading = CENTRES[position]
    pose = camera_pose(np.array(centre), np.radians(heading), np.radians(28.0))
    return Camera(
        camera_pose(pose.apply(np.array([0.3 * (side == "R"), 0, 0])), np.radians(heading), np.radians(28.0)), LENS
    )


def photograph(at: Camera, heights: Callable[..., np.ndarray], pattern: np.ndarray) -> np.ndarray:
    """Return a picture (h, w) of the pattern on the height field."""
    x, y = np.moveaxis(LARGER.centres(), -1, 0)
    mesh = height_mesh(LARGER, heights(x, y))
    directions = at.pixel_directions().reshape(-1, 3)
    origins = np.broadcast_to(at.centre, directions.shape)
    distance, _ = make_caster(mesh.vertices, mesh.faces).nearest(origins, directions)
    hit = np.isfinite(distance)
    picture = np.full(len(directions), 1.0)
    picture[hit] = LARGER.sample(pattern, origins[hit] + distance[hit, None] * directions[hit])
    return (100 * picture).reshape(LENS.shape).astype(np.float32)


def view(position: str, side: str, azimuth: str, pattern: np.ndarray) -> PhotoView:
    key = PhotoKey.parse(f"01_{position}_off_{azimuth}_{side}_0256")
    at = camera(position, side)
    return PhotoView(key, photograph(at, relief, pattern), at, SUN_LAMPS[azimuth], linear=True)


def level(grid: FloorGrid = GRID) -> HeightMap:
    return HeightMap(grid, np.zeros(grid.shape), np.full(grid.shape, np.inf), np.zeros(grid.shape, np.uint8))

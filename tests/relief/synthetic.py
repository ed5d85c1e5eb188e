"""Synthetic ground with known heights, and photos of it by the renderer."""

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.poses import camera_pose
from polarsim.geometry.rays import Caster, NumpyCaster
from polarsim.photo import NO_ROCK, PhotoKey
from polarsim.relief.heights import HeightMap, PhotoView
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.scans import Extent
from polarsim.run_files.scene import TerrainMesh

HALF = 0.6  # metres; the photos show all of it
GRID = FloorGrid(Extent(-HALF, -HALF, HALF, HALF), 0.015)
SUNS = {"30": 30.0, "180": 180.0, "270": 270.0, "350": 350.0}
OPTIONS = RenderOptions(models=("principled",), walls=False, bounce=0.0)
PARAMETERS = OPTIONS.parameters("principled", "ground")
NOTHING: Caster = NumpyCaster(np.zeros((0, 3)), np.zeros((0, 3), int))
CAMERA = Camera(
    camera_pose(np.array([1.7, 0.0, 1.0]), np.pi, np.radians(30)), Lens(520, 520, 320, 200, width=640, height=400)
)


def lamp(azimuth: str) -> np.ndarray:
    """Return the position (3,) of a lamp 4 m away, 17 degrees above the ground."""
    angle = np.radians(SUNS[azimuth])
    return np.array([4 * np.cos(angle), 4 * np.sin(angle), 1.2])


def rocks(*places: tuple[float, float]) -> Mesh:
    """Return pyramids, 8 cm wide and 7 cm high, at places (x, y)."""
    corners = np.array([[-0.04, -0.04, -0.02], [0.04, -0.04, -0.02], [0.04, 0.04, -0.02], [-0.04, 0.04, -0.02]])
    pyramid = np.vstack([corners, [[0.0, 0.0, 0.07]]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    return join_meshes([Mesh(pyramid + np.array([*place, 0.0]), faces) for place in places])


def photo(heights: np.ndarray, azimuth: str, gain: float = 1000.0, rocky: Mesh | None = None) -> PhotoView:
    """Return a linear photo of a ground with heights (rows, columns) of `GRID` and rocks under one lamp."""
    x, y = np.moveaxis(GRID.centres(), -1, 0)
    parts = [grid_mesh(x, y, heights), *([rocky] if rocky else [])]
    whole = join_meshes(parts)
    numbers = np.repeat([NO_ROCK, 1][: len(parts)], [len(part.faces) for part in parts])
    ground = TerrainMesh(whole.vertices, whole.faces, numbers)
    lamps = {azimuth: Lamp(lamp(azimuth))}
    rendered = render_view(build_surfaces(ground, OPTIONS), CAMERA, lamps, ["principled"], None, OPTIONS)
    picture = gain * rendered.whole["principled", azimuth] + 0.01
    key = PhotoKey(3, "A", "off", azimuth, "L", 256)  # type: ignore[arg-type]
    return PhotoView(key, picture.astype(np.float32), CAMERA, lamp(azimuth), linear=True)


def level(height: float = 0.0) -> HeightMap:
    """Return a level ground about which nothing is known."""
    shape = GRID.shape
    return HeightMap(GRID, np.full(shape, height), np.full(shape, np.inf), np.zeros(shape, np.uint8))


def bump(x0: float = 0.0, y0: float = 0.0, height: float = 0.02, sigma: float = 0.08) -> np.ndarray:
    """Return heights (rows, columns) of a Gaussian bump; a negative height is a bowl."""
    x, y = np.moveaxis(GRID.centres(), -1, 0)
    return height * np.exp(-((x - x0) ** 2 + (y - y0) ** 2) / (2 * sigma**2))

"""Photos of level sand in the shadow of walls, under a disc lamp."""

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.photo import NO_ROCK
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import Walls
from polarsim.site import polar

DISC_POINTS = 64
LAMP_RADIUS = polar().lamps["30"].radius_m
GROUND = Mesh(np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], float), np.array([[0, 1, 2], [0, 2, 3]]))


def level_sand(*rocks: Mesh, walls: Walls | None = None) -> TerrainMesh:
    whole = join_meshes([GROUND, *rocks])
    rock_of_face = np.repeat([NO_ROCK, 1], [2, len(whole.faces) - 2])
    return TerrainMesh(whole.vertices, whole.faces, rock_of_face, walls=walls)


def shaded_sand(camera: Camera, walls: Walls, lamp: np.ndarray) -> np.ndarray:
    """Return the visible share (h, w) of the disc of a lamp near the edges of the shadows of walls, else 0."""
    directions = camera.pixel_directions().reshape(-1, 3)
    level = camera.centre - camera.centre[2] / np.minimum(directions[:, 2:], -1e-6) * directions
    distance = np.abs(level[:, :2])
    near = np.flatnonzero((np.abs(distance.max(axis=1) - 1.1) < 0.7) & (distance.min(axis=1) < 1.5))
    axis = lamp / np.linalg.norm(lamp)
    side = np.cross(axis, [0, 0, 1.0]) / np.linalg.norm(np.cross(axis, [0, 0, 1.0]))
    share = np.zeros(len(near))
    for number in range(DISC_POINTS):  # on a Fibonacci spiral
        radius, angle = LAMP_RADIUS * np.sqrt((number + 0.5) / DISC_POINTS), number * 2.39996
        on_disc = lamp + radius * (np.cos(angle) * side + np.sin(angle) * np.cross(side, axis))
        share += walls.clearance(level[near], on_disc) > 0
    rate = np.zeros(len(level), np.float32)
    rate[near] = 0.02 + share / DISC_POINTS
    return rate.reshape(camera.lens.shape)

"""Parts of small worlds: options, level or sloped ground, spherical rocks."""

import numpy as np
import trimesh

from polarsim.geometry.meshes import Mesh
from polarsim.rover.world.options import WorldOptions

SMALL = WorldOptions(terrains=(4, 1), width_m=5.0, margin_m=1.0, cell_m=0.05)


def plane(height: float, slope: float = 0.0, half: float = 2.0) -> Mesh:
    """Return a square of ground that rises along y."""
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    return Mesh(np.column_stack([corners, height + slope * corners[:, 1]]), np.array([[0, 1, 2], [0, 2, 3]]))


def ball(x: float, y: float, z: float, radius: float = 0.1) -> Mesh:
    mesh = trimesh.creation.icosphere(2, radius)
    return Mesh(np.asarray(mesh.vertices) + np.array([x, y, z]), np.asarray(mesh.faces))

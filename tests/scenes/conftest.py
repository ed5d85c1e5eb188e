import numpy as np
import pytest

from polarsim.geometry.meshes import Mesh
from polarsim.render.surfaces import box_mesh
from polarsim.scenes.layout import RockShape


def block(*size):
    """Return an axis-aligned box of a size (x, y, z), metres, not centred at the origin."""
    high = np.array([*size, 0.0][:3])
    vertices, faces, _ = box_mesh(np.zeros(3), high)
    return Mesh(vertices + 5, faces)


@pytest.fixture
def shapes():
    """A small and a large rock: 0.1 m and 0.3 m long."""
    return [RockShape(block(0.1, 0.06, 0.05)), RockShape(block(0.3, 0.2, 0.2))]

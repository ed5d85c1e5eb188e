"""Static ground of a drive, inside and outside the grid."""

import numpy as np
import pytest
from scipy import ndimage

from polarsim.rover.cameras.render_scene import static_ground, surrounding_ground
from polarsim.rover.cameras.tracks import NodeGrid, WheelTracks
from polarsim.rover.world.surface import WorldBackdrop

CELL = 0.02
SHAPE = (120, 150)


@pytest.fixture
def lattice(rng):
    rough = ndimage.gaussian_filter(rng.normal(0, 1, SHAPE), 1.5)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] * CELL
    return NodeGrid(0.3, -0.7, CELL, 0.01 * rough / rough.std() + 0.02 * x - 0.03 * y)


def grid(vertices, axis):
    """Return a coordinate of the vertices by node, (rows, columns)."""
    columns = len(np.unique(vertices[:, 0]))
    return vertices.reshape(-1, columns, 3)[..., axis]


def test_static_ground_equals_the_grid_without_covered_cells(lattice):
    covered = np.zeros((SHAPE[0] - 1, SHAPE[1] - 1), bool)
    vertices, faces, _ = static_ground(lattice, covered, 0.0)
    np.testing.assert_allclose(grid(vertices, 2), lattice.level)
    np.testing.assert_allclose(vertices[0, :2], [0.3, -0.7])
    assert len(faces) == 2 * covered.size
    covered[3:5, 7:10] = True
    assert len(static_ground(lattice, covered, 0.0)[1]) == 2 * (covered.size - 6)


def test_heights_of_the_rim_fade_outside_the_grid_without_radial_streaks(lattice):
    vertices, _, _ = static_ground(lattice, np.zeros((SHAPE[0] - 1, SHAPE[1] - 1), bool), 20.0)
    y, z = grid(vertices, 1), grid(vertices, 2)
    count = (z.shape[0] - SHAPE[0]) // 2
    inner = slice(count, count + SHAPE[1])
    np.testing.assert_allclose(z[count, inner], lattice.level[0])
    rim = np.abs(np.diff(z[count, inner])).mean()
    distance = lattice.y0 - y[:count, 0]
    steps = np.abs(np.diff(z[:count, inner], axis=1)).mean(axis=1)
    assert steps[-1] > 0.7 * rim  # roughness continues near the rim
    assert (steps[distance > 0.3] < 0.1 * rim).all()
    assert np.abs(z[0] - np.median(z[0])).max() < 1e-6  # flat in the distance
    assert np.abs(np.diff(z, axis=0)[:count]).max() < 0.05


def test_surroundings_and_grid_form_a_single_mesh(lattice):
    """Node distances double with each step outside the rim; inside, the heights are those of the lattice."""
    steps = CELL * (2.0 ** np.arange(1, 9) - 1)
    x, y = (
        np.concatenate([start - steps[::-1], start + CELL * np.arange(size), start + CELL * (size - 1) + steps])
        for start, size in ((lattice.x0, SHAPE[1]), (lattice.y0, SHAPE[0]))
    )
    around = WorldBackdrop(x, y, 0.02 * x - 0.03 * y[:, None], np.zeros((0, 3)), np.zeros((0, 3), int))
    changed = np.zeros(SHAPE, bool)
    changed[60, 70] = True
    tracks = WheelTracks(lattice, changed, finer=2)
    vertices, faces, normals = surrounding_ground(tracks, around)
    z = grid(vertices, 2)
    inner = tuple(slice(8, 8 + size) for size in tracks.fine.level.shape)
    np.testing.assert_array_equal(z[inner], tracks.fine.level)
    corners = z[0, 0], z[-1, -1]
    np.testing.assert_allclose(corners, [0.02 * x[0] - 0.03 * y[0], 0.02 * x[-1] - 0.03 * y[-1]])
    assert len(faces) == 2 * ((z.shape[0] - 1) * (z.shape[1] - 1) - tracks.covered.sum())
    up = np.cross(*(vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2)))
    assert (up[:, 2] > 0).all()
    plane = np.array([-0.02, 0.03, 1.0]) / np.linalg.norm([-0.02, 0.03, 1.0])
    np.testing.assert_allclose(normals[0], plane, atol=1e-6)

"""The control changes only the heights of the ground."""

import numpy as np
import pytest

from polarsim.cover_photos.control import RELIEF_SD_M, invent_relief
from polarsim.errors import DetectError
from polarsim.formats import obj
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.meshes import Mesh
from polarsim.render.surfaces import box_mesh


@pytest.fixture
def meshes(tmp_path):
    """A tilted ground of 10 mm cells and a rock."""
    x, y = np.meshgrid(np.arange(-1, 1.005, 0.01), np.arange(-0.5, 0.505, 0.01))
    ground = grid_mesh(x, y, 0.02 * x)
    obj.write_obj(tmp_path / "meshes/terrain03_ground.obj", ground, "ground")
    vertices, faces, _ = box_mesh(np.zeros(3), np.array([0.2, 0.15, 0.1]))
    obj.write_obj(tmp_path / "meshes/terrain03_rock1.obj", Mesh(vertices, faces), "rock")
    return tmp_path / "meshes"


def relief(meshes, control):
    before, after = (obj.read_obj(folder / "terrain03_ground.obj") for folder in (meshes, control))
    np.testing.assert_array_equal(before.faces, after.faces)
    np.testing.assert_array_equal(before.vertices[:, :2], after.vertices[:, :2])
    return after.vertices[:, 2] - before.vertices[:, 2]


def test_relief_has_the_given_strength_and_is_smooth_between_vertices(meshes, tmp_path):
    invent_relief(terrain=3, meshes=meshes, control=tmp_path / "control", seed=0)
    heights = relief(meshes, tmp_path / "control")
    assert heights.std() == pytest.approx(RELIEF_SD_M, rel=0.3)
    steps = np.diff(heights.reshape(101, 201), axis=1)
    assert np.degrees(np.arctan(np.abs(steps).max() / 0.01)) < 40  # below the slope of repose of sand
    rocks = [folder / "terrain03_rock1.obj" for folder in (meshes, tmp_path / "control")]
    assert rocks[0].read_bytes() == rocks[1].read_bytes()


def test_relief_depends_on_the_seed_only(meshes, tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        invent_relief(terrain=3, meshes=meshes, control=tmp_path / name, seed=seed)
    a, b, c = (relief(meshes, tmp_path / name) for name in "abc")
    np.testing.assert_array_equal(a, b)
    assert np.corrcoef(a, c)[0, 1] < 0.5


def test_relief_does_not_depend_on_the_order_of_vertices(meshes, tmp_path):
    invent_relief(terrain=3, meshes=meshes, control=tmp_path / "control", seed=0)
    expected = relief(meshes, tmp_path / "control")
    ground = obj.read_obj(meshes / "terrain03_ground.obj")
    order = np.random.default_rng(0).permutation(len(ground.vertices))
    shuffled = Mesh(ground.vertices[order], np.argsort(order)[ground.faces])
    obj.write_obj(meshes / "terrain03_ground.obj", shuffled, "ground")
    invent_relief(terrain=3, meshes=meshes, control=tmp_path / "shuffled", seed=0)
    np.testing.assert_allclose(relief(meshes, tmp_path / "shuffled"), expected[order], atol=2e-6)


def test_a_ground_off_a_grid_is_an_error(meshes, tmp_path):
    vertices, faces, _ = box_mesh(np.zeros(3), np.array([2.0, 2, 0.1]))
    obj.write_obj(meshes / "terrain03_ground.obj", Mesh(vertices, faces), "ground")
    with pytest.raises(DetectError, match="terrain03_ground"):
        invent_relief(terrain=3, meshes=meshes, control=tmp_path / "control", seed=0)
    assert not (tmp_path / "control").exists()

from dataclasses import replace

import numpy as np
import pytest

from polarsim.formats import png
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from polarsim.photo import BLACK_LEVEL
from polarsim.render.lamps import Lamp
from polarsim.render.maps import write_maps
from polarsim.render.scene import Scene, Shot
from polarsim.run_files.instances import GROUND, ROCK_IDS

from .conftest import HEIGHT, PLAIN

ABOVE = 3.0  # metres, height of the camera with a vertical optical axis


@pytest.fixture
def scene(folders):
    return Scene(folders / "meshes", 1, PLAIN)


@pytest.fixture
def shot(lens):
    pose = camera_pose(np.array([1.5, 1.5, 1.5]), -2.4, 0.6)
    return Shot(Camera(pose, lens), {"mine": Lamp(np.array([0.0, 3.0, 1.0]))}, 100.0, "principled")


@pytest.fixture
def from_above(shot, above):
    return replace(shot, camera=replace(shot.camera, world_from_camera=above))


def test_an_image_of_any_pose_and_lamp(scene, shot):
    one = scene.picture(shot)
    assert one.dtype == np.uint16
    assert (one > BLACK_LEVEL).mean() > 0.3
    assert (scene.picture(replace(shot, lamps={})) == BLACK_LEVEL).all()
    below = {"below": Lamp(np.array([0.0, 0, -3.0]))}
    assert (scene.picture(replace(shot, lamps=below)) == BLACK_LEVEL).all()
    assert scene.picture(replace(shot, exposure_ms=200.0)).mean() > 1.5 * one.mean()


def test_depth_and_normals_of_block_and_ground(scene, from_above):
    maps = scene.maps(from_above)
    block, ground = maps.ids == ROCK_IDS + 1, maps.ids == GROUND
    top = block & (maps.normal[..., 2] > 0.99)
    np.testing.assert_allclose(maps.depth_m[top], ABOVE - HEIGHT, rtol=1e-6)
    np.testing.assert_allclose(maps.depth_m[ground], ABOVE, rtol=1e-6)
    np.testing.assert_allclose(maps.normal[ground], np.tile([0, 0, 1.0], (ground.sum(), 1)), atol=1e-6)
    nothing = maps.ids == 0
    assert np.isnan(maps.depth_m[nothing]).all()


def test_angles_agree_with_lamp_and_viewer(scene, from_above):
    maps = scene.maps(from_above)
    row, column = np.argwhere(maps.ids == GROUND)[100]
    camera = from_above.camera
    position = camera.centre + camera.directions(np.array([column + 0.5, row + 0.5])) * maps.depth_m[row, column]
    to_lamp, to_viewer = np.array([0.0, 3, 1]) - position, np.array([0, 0, ABOVE]) - position
    to_lamp, to_viewer = (v / np.linalg.norm(v) for v in (to_lamp, to_viewer))
    expected = np.degrees(np.arccos([to_lamp[2], to_viewer[2], to_lamp @ to_viewer]))
    mine = maps.by_lamp["mine"]
    found = [angle[row, column] for angle in (mine.incidence_deg, maps.emergence_deg, mine.phase_deg)]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert scene.maps(replace(from_above, lamps={})).by_lamp == {}


def test_maps_in_files_keep_millimetres_and_hundredths_of_degrees(tmp_path, scene, from_above):
    maps = scene.maps(from_above)
    write_maps(tmp_path / "maps", maps)
    seen = maps.ids > 0
    depth, phase, normal = (png.read_png(tmp_path / "maps" / f"{name}.png") for name in ("depth", "phase", "normal"))
    np.testing.assert_allclose(depth[seen] / 1000, maps.depth_m[seen], atol=5.1e-4)
    np.testing.assert_allclose(phase[seen] / 100, maps.by_lamp["mine"].phase_deg[seen], atol=5.1e-3)
    np.testing.assert_allclose(normal[seen] / 65535 * 2 - 1, maps.normal[seen], atol=2e-5)
    assert (depth[~seen] == 65535).all()
    np.testing.assert_array_equal(png.read_png(tmp_path / "maps" / "ids.png"), maps.ids)

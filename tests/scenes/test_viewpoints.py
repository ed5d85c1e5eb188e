"""Random cameras and lamps of scenes."""

import numpy as np
import pytest

from polarsim.errors import DetectError
from polarsim.geometry.camera import Camera
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose, yaw_pitch_roll
from polarsim.photo import NO_ROCK
from polarsim.randomness import generator
from polarsim.render.hits import cast_strip
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import level_walls
from polarsim.scenes.options import SceneRanges
from polarsim.scenes.viewpoints import coarse_sand, draw_camera, draw_lamp, level_sand

LENS = Lens(64, 64, 30, 19, width=60, height=38)


def level(half, height):
    x, y = np.meshgrid([-half, half], [-half, half])
    ground = grid_mesh(x, y, np.zeros_like(x))
    mesh = TerrainMesh(ground.vertices, ground.faces, np.full(2, NO_ROCK), walls=level_walls(half, height))
    return build_surfaces(mesh, RenderOptions(walls=height > 0))


@pytest.mark.parametrize(("x", "height", "pitch"), [(-3.5, 1.5, 25), (-3.0, 0.5, 8), (0.0, 0.4, 20), (-2.2, 0.35, 10)])
def test_visible_sand_agrees_with_rays(x, height, pitch):
    """Comparison with rays of the renderer for cameras outside, near and inside the walls."""
    camera = Camera(camera_pose(np.array([x, 0.3, height]), 0.1, np.radians(pitch)), LENS)
    points = level_sand(camera, 2.0, 0.3)
    surfaces = level(2.0, 0.3)
    hits = cast_strip(surfaces, camera, slice(0, 38), smooth=False)
    hit = hits.point[surfaces.id_of_face.take(hits.face) == 1][:, :2]
    assert len(points) == pytest.approx(len(hit), rel=0.06)  # the thickness of the walls occludes slightly more sand
    assert np.abs(points).max() <= 2.0


def test_random_cameras_are_in_their_ranges_and_show_sand():
    options = SceneRanges()
    headings = []
    for number in range(40):
        camera, seen = draw_camera(2.05, 0.25, options, generator(number, "camera"))
        assert camera.lens.shape == (608, 968)
        assert options.focal_px[0] / 2 <= camera.lens.fx <= options.focal_px[1] / 2
        assert options.camera_height_m[0] <= camera.centre[2] <= options.camera_height_m[1]
        assert len(seen) >= options.min_sand_share * 60 * 38
        headings.append(yaw_pitch_roll(camera.world_from_camera)[0])
    assert np.abs(np.exp(1j * np.array(headings)).mean()) < 3 / np.sqrt(40)  # all around


def test_cameras_that_show_no_sand_are_rejected():
    options = SceneRanges(camera_height_m=(0.3, 0.3), camera_distance_m=(900, 1000))
    with pytest.raises(DetectError):
        draw_camera(2.0, 0.36, options, generator(0, "camera"))


@pytest.mark.parametrize("near_share", [0.0, 1.0])
def test_random_lamps_are_in_their_ranges(near_share):
    options = SceneRanges(near_share=near_share, elevation_deg=(4, 9), lamp_distance_m=(3, 5), min_lit_share=0)
    surfaces = level(3.0, 0.0)
    camera = Camera(camera_pose(np.array([-2.0, 0, 1.0]), 0, 0.4), Lens(1000, 1000, 484, 304, width=968, height=608))
    sand = coarse_sand(surfaces, camera, options)
    for number in range(20):
        lamp = draw_lamp(surfaces, sand, options, generator(number, "lamp"))
        away = np.linalg.norm(lamp.position)
        assert 4 <= np.degrees(np.arcsin(lamp.position[2] / away)) <= 9
        assert (3 <= away <= 5) == bool(near_share)
        assert lamp.distant != bool(near_share)


def test_lamps_light_the_minimum_share_of_sand():
    """Walls shade a part of the sand under a low Sun; only a sufficiently high Sun lights three quarters."""
    options = SceneRanges(near_share=0, min_lit_share=0.75)
    surfaces = level(2.0, 0.3)
    camera = Camera(camera_pose(np.array([0, 0, 2.0]), 0, np.pi / 2), Lens(500, 500, 484, 304, width=968, height=608))
    sand = coarse_sand(surfaces, camera, options)
    for number in range(10):
        lamp = draw_lamp(surfaces, sand, options, generator(number, "lamp"))
        to_lamp, _ = lamp.light_at(sand.point, falloff=False)
        assert 1 - surfaces.all.occluded(sand.point, to_lamp, 1.0).mean() >= 0.75

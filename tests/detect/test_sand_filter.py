"""Boxes outside the sand are dropped in photos with a known camera pose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.detect.sand_filter import SandFilter, boxes_on_sand
from polarsim.errors import DetectError, FormatError
from polarsim.formats import obj
from polarsim.geometry.camera import Camera
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.site import polar
from tests.support.other_site import other_site
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import HALF, SURELY_WALL

KEY = "01_A_off_30_L_0256"
RIG = LocalisedRig(default_rig(), camera_pose(np.array([-3.2, 0.0, 1.0]), 0.0, np.radians(12)), "labels")
CAMERA = RIG.camera("L")
STEEP = Camera(camera_pose(np.array([-3.2, 0.0, 1.0]), 0.0, np.radians(30)), CAMERA.lens)  # sees the wall before it
SIDE_PX = 40.0


def standing_at(x, y, kind=0):
    """Return the box (1, 6) of a rock or shadow with its foot at a point of the sand."""
    (u, v) = CAMERA.project(np.array([x, y, 0.0]))
    low = v if kind == 0 else v + SIDE_PX / 2
    return np.array([[u - SIDE_PX / 2, low - SIDE_PX, u + SIDE_PX / 2, low, 0.9, kind]])


def write_ground(folder, level=0.0):
    corners = np.array([[-2.0, -2, level], [2, -2, level], [2, 2, level], [-2, 2, level]])
    obj.write_obj(folder / "terrain01_ground.obj", Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), "ground")


@given(st.floats(-1.1, 4), st.floats(-1, 1), st.sampled_from([0, 1]))
def test_a_box_is_on_the_sand_if_its_foot_is(x, y, kind):
    if abs(x - HALF[0]) > 1e-6:
        assert boxes_on_sand(standing_at(x, y, kind), CAMERA, 0.0, HALF, SURELY_WALL).tolist() == [x < HALF[0]]


def test_nothing_above_the_horizon_is_on_the_sand():
    sky = np.array([[900.0, -40, 940, 0.5, 0.9, 0]])
    assert CAMERA.directions(np.array([920.0, 0.5]))[2] > 0
    assert not boxes_on_sand(sky, CAMERA, 0.0, HALF, SURELY_WALL)[0]


def test_higher_sand_covers_less_of_the_photo():
    wall = standing_at(2.3, 0.0)
    assert not boxes_on_sand(wall, CAMERA, 0.0, HALF, SURELY_WALL)[0]
    assert boxes_on_sand(wall, CAMERA, 0.2, HALF, SURELY_WALL)[0]


@given(st.floats(-1.95, -0.8))
def test_the_near_wall_hides_sand(x):
    """The height of a ray to the sand at the wall (1.2 m) follows from the triangle of camera, wall and sand."""
    above = 1.0 * (x + 2.0) / (x + 3.2)
    if abs(above - SURELY_WALL) > 1e-6:
        u, v = STEEP.project(np.array([x, 0.0, 0.0]))
        shadow = np.array([[u - 20, v - 20, u + 20, v + 20, 0.9, 1]])
        assert boxes_on_sand(shadow, STEEP, 0.0, HALF, SURELY_WALL)[0] == (above > SURELY_WALL)


def test_a_rock_partly_hidden_by_the_near_wall_is_kept():
    """The box ends at the edge of the wall in the photo, or slightly below because of detector errors."""
    edge = STEEP.project(np.array([-HALF[0], 0.0, SURELY_WALL]))[1]
    box = np.array([[900.0, edge - 60, 990, edge + 3, 0.9, 0]])
    assert boxes_on_sand(box, STEEP, 0.0, HALF, SURELY_WALL)[0]
    lower = np.array([0, 80, 0, 80, 0, 0])
    assert not boxes_on_sand(box + lower, STEEP, 0.0, HALF, SURELY_WALL)[0]  # cloth on the wall itself


@pytest.mark.parametrize(
    ("rigs", "kept"),
    [({"A": RIG}, 1), ({"B": RIG}, 2), ({"A": replace(RIG, method="survey")}, 2), ({}, 2)],
    ids=["known", "other position", "surveyed alone", "none"],
)
def test_photos_without_a_pose_keep_all_boxes(rigs, kept, tmp_path):
    cameras, meshes = tmp_path / "cameras/Terrain01", tmp_path / "meshes/Terrain01"
    cameras.mkdir(parents=True)
    write_ground(meshes)
    for position, rig in rigs.items():
        write_localised(cameras / f"Pos{position}.json", rig)
    found = np.concatenate([standing_at(0, 0), standing_at(3, 0)])
    sand = SandFilter.read(polar(), [cameras], [meshes])
    assert len(sand.keep(KEY, found)) == kept
    assert len(sand.keep("03" + KEY[2:], found)) == 2


def test_the_sand_level_is_read_from_the_ground_mesh(tmp_path):
    """The sand level differs between the frames of published meshes."""
    cameras, meshes = tmp_path / "cameras/Terrain01", tmp_path / "meshes/Terrain01"
    write_localised(cameras / "PosA.json", RIG)
    for level, kept in ((0.0, 0), (0.2, 1)):
        write_ground(meshes, level)
        assert len(SandFilter.read(polar(), [cameras], [meshes]).keep(KEY, standing_at(2.3, 0.0))) == kept


def test_unpaired_folders_and_missing_ground_are_errors(tmp_path):
    cameras, meshes = tmp_path / "cameras/Terrain01", tmp_path / "meshes/Terrain01"
    with pytest.raises(FormatError):
        SandFilter.read(polar(), [cameras], [meshes])
    write_ground(meshes)
    with pytest.raises(DetectError):
        SandFilter.read(polar(), [tmp_path / "cameras/Terrain03"], [meshes])


def test_the_filter_lists_its_input_files(tmp_path):
    """An interrupted prediction does not resume after a change of poses or ground."""
    cameras, meshes = tmp_path / "cameras/Terrain01", tmp_path / "meshes/Terrain01"
    write_ground(meshes)
    write_localised(cameras / "PosA.json", RIG)
    assert SandFilter.read(polar(), [cameras], [meshes]).files == (
        cameras / "PosA.json",
        meshes / "terrain01_ground.obj",
    )
    assert SandFilter.read(polar(), [], []).files == ()


def test_sand_of_a_named_terrain_has_the_sandbox_of_its_site(tmp_path):
    """Boxes at x 1.7 m are beside the sand of a yard 3 m wide, and on the sand of one that is 4 m wide."""
    cameras, meshes = tmp_path / "cameras/Terrainyard-a", tmp_path / "meshes/Terrainyard-a"
    write_localised(cameras / "PosA.json", RIG)
    write_ground(meshes)
    (meshes / "terrain01_ground.obj").rename(meshes / "terrainyard-a_ground.obj")
    found, key = standing_at(1.7, 0.0), KEY.replace("01", "yard-a")
    for half, kept in (([1.5, 3.0], 0), ([2.0, 3.0], 1)):
        site = other_site(sandbox={"half_width_m": half})
        assert len(SandFilter.read(site, [cameras], [meshes]).keep(key, found)) == kept

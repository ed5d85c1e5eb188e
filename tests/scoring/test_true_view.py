import numpy as np

from polarsim.formats import nasa
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import rectified_left
from polarsim.run_files.inventory import Inventory
from polarsim.run_files.rigs import LocalisedRig
from polarsim.scoring.surface import Surface
from polarsim.scoring.true_surface import true_views
from tests.support.polar_rig import default_rig

DOWN = Pose(np.diag([1.0, -1, -1]), np.array([0.0, 0, 3]))  # 3 m above the floor, looking straight down
FLOOR = Surface(np.array([[-5.0, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
PLACES = np.array([[0.0, 0, 0], [0.3, 0.2, 0], [4.0, 0, 0]])  # the last point is outside the image
UP = np.tile([0.0, 0, 1], (3, 1))


def seen(known=None):
    grid = rectified_left(default_rig())
    rig = LocalisedRig(default_rig(), DOWN @ grid.left_from_rectified.inverse())
    (view,) = true_views({"A": rig, "B": rig}, {"A"}, known)
    return view.visible(FLOOR, PLACES, UP).tolist(), view.visible(FLOOR, PLACES, -UP).tolist()


def test_without_range_map_points_inside_the_image_that_face_the_camera_are_visible():
    assert seen() == ([True, True, False], [False, False, False])


def test_a_point_without_a_return_is_invisible(tmp_path):
    lens = rectified_left(default_rig()).lens
    points = 3.0 * lens.pixel_directions()
    points[:, : int(lens.cx) + 20] = np.nan  # the left half of the image has no returns
    nasa.write_range_map(tmp_path / "map.tif", points)
    assert seen(Inventory(1, "files", range_maps={"A": str(tmp_path / "map.tif")}))[0] == [False, True, False]


def test_a_point_behind_a_closer_return_is_invisible(tmp_path):
    lens = rectified_left(default_rig()).lens
    nasa.write_range_map(tmp_path / "map.tif", 2.9 * lens.pixel_directions())
    assert seen(Inventory(1, "files", range_maps={"A": str(tmp_path / "map.tif")}))[0] == [False, False, False]

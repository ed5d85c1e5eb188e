import numpy as np
import pycolmap
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats.colmap import write_model
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.run_files.rigs import LocalisedRig
from tests.support.polar_rig import default_rig

RIGHT_OF_LEFT = Pose.from_rotvec(np.array([-0.007, -0.004, 0.002]), np.array([0.3, 0.001, -0.006]))
LOCALISED = {
    "A": LocalisedRig(default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, 0.44, -0.01)),
    "C": LocalisedRig(default_rig(), camera_pose(np.array([0.8, -3.8, 1.5]), 1.8, 0.45, 0.03)),
}


def number(low, high):
    return st.floats(low, high, allow_nan=False, width=64)


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(number(-7, 7), number(-7, 7), number(0, 3), number(-3.1, 3.1), number(-1.5, 1.5), number(-0.3, 0.3)),
    st.tuples(number(500, 4000), number(500, 4000), number(1, 1936), number(1, 1216)),
    st.tuples(*[number(-0.2, 0.2)] * 5),
)
def test_a_model_reads_back(tmp_path_factory, position, lens, distortion):
    rig = StereoRig(Lens(*lens, distortion, width=1936, height=1216), default_rig().right, RIGHT_OF_LEFT)
    localised = LocalisedRig(rig, camera_pose(np.array(position[:3]), *position[3:]))
    folder = tmp_path_factory.mktemp("model") / "colmap"
    write_model(folder, {"B": localised})
    model = pycolmap.Reconstruction(str(folder))
    assert model.num_images() == 2
    for camera, pose in (("L", localised.sandbox_from_left), ("R", localised.sandbox_from_left @ RIGHT_OF_LEFT)):
        image = model.find_image_with_name(f"PosB_Cam{camera}")
        np.testing.assert_allclose(
            Pose.from_matrix(image.cam_from_world().matrix()).inverse().matrix, pose.matrix, atol=1e-9
        )
        own = rig.lens(camera)
        expected = [own.fx, own.fy, own.cx, own.cy, *own.distortion]
        assert [*image.camera.params, 0.0][: len(expected)] == expected


@pytest.mark.parametrize("camera", ["L", "R"])
def test_colmap_projects_points_to_the_same_pixels(tmp_path, camera):
    write_model(tmp_path / "colmap", LOCALISED)
    model = pycolmap.Reconstruction(str(tmp_path / "colmap"))
    points = np.array([[0.0, 0, 0], [0.9, 0.7, 0.1], [-0.8, 0.5, -0.1], [0.2, -1.0, 0.05]])
    for position, localised in LOCALISED.items():
        image = model.find_image_with_name(f"Pos{position}_Cam{camera}")
        seen = [image.project_point(point) for point in points]
        np.testing.assert_allclose(localised.project(camera, points), np.array(seen), atol=1e-6)


def test_the_same_rigs_give_the_same_bytes(tmp_path):
    for name in ("first", "second"):
        write_model(tmp_path / name, LOCALISED)
    files = sorted(path.name for path in (tmp_path / "first").iterdir())
    assert files == ["cameras.txt", "frames.txt", "images.txt", "points3D.txt", "rigs.txt"]
    for name in files:
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


def test_positions_with_different_rigs_are_an_error(tmp_path):
    other = StereoRig(default_rig().left, default_rig().right, RIGHT_OF_LEFT)
    with pytest.raises(FormatError) as error:
        write_model(
            tmp_path / "colmap", {"A": LOCALISED["A"], "B": LocalisedRig(other, LOCALISED["A"].sandbox_from_left)}
        )
    assert error.value.path == tmp_path / "colmap"
    assert not (tmp_path / "colmap").exists()


PHOTO = b"not decoded here"


@pytest.mark.parametrize(
    "named", ["my data/Pos{}/Cam{}_7_0256.png", "a\tb/Pos{}_Cam{} (1).PNG", "Würfel/Pos{}_Cam{}.png"]
)
def test_photos_with_blanks_in_paths_are_linked(tmp_path, named):
    pictures = {(p, camera): f"../{named.format(p, camera)}" for p in LOCALISED for camera in "LR"}
    for name in pictures.values():
        (tmp_path / "colmap" / name).resolve().parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "colmap" / name).resolve().write_bytes(PHOTO + name.encode())
    write_model(tmp_path / "colmap", LOCALISED, pictures)
    model = pycolmap.Reconstruction(str(tmp_path / "colmap"))
    for image in model.images.values():
        content = (tmp_path / "colmap" / image.name).read_bytes()
        position, camera = next(view for view, name in pictures.items() if PHOTO + name.encode() == content)
        expected = LOCALISED[position].project(camera, np.array([[0.9, 0.7, 0.1]]))
        np.testing.assert_allclose(image.project_point([0.9, 0.7, 0.1]), expected[0], atol=1e-6)


def test_missing_photos_are_named_by_position_and_camera(tmp_path):
    pictures = {(p, camera): f"../my data/Pos{p}/Cam{camera}_7.png" for p in LOCALISED for camera in "LR"}
    write_model(tmp_path / "colmap", LOCALISED, pictures)
    model = pycolmap.Reconstruction(str(tmp_path / "colmap"))
    assert sorted(image.name for image in model.images.values())[0] == "PosA_CamL"

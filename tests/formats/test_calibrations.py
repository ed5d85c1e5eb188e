"""Calibrations of OpenCV, ROS, Kalibr and COLMAP describe the same rig as the one that they were written from."""

import cv2
import numpy as np
import pytest
import yaml

from polarsim.errors import ConfigError, FormatError
from polarsim.formats import colmap
from polarsim.formats.calibrations import read_calibration, stated_rig
from polarsim.geometry.poses import camera_pose
from polarsim.run_files.rigs import LocalisedRig
from tests.support.other_site import SIZE, one_camera, other_rig, other_site

RIG = other_rig()
MATRIX, TERMS = [lens.opencv_matrix() for lens in (RIG.left, RIG.right)], np.array(RIG.left.distortion)
MOTION = RIG.left_from_right.inverse()
FLAT = {"rows": 3, "cols": 3}


def opencv_file(path, names, *, size=True):
    """Write a file as OpenCV's programs do."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if size:
        file.write("image_width", SIZE[0])
        file.write("image_height", SIZE[1])
    for name, value in names.items():
        file.write(name, value)
    file.release()


SPELLINGS = {
    "left and right": ("camera_matrix_left", "distortion_coefficients_left", "camera_matrix_right",
                       "distortion_coefficients_right", "rotation_matrix", "translation_vector"),
    "stereo_calib of OpenCV": ("M1", "D1", "M2", "D2", "R", "T"),
    "camel case": ("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T"),
    "prefixes": ("left_K", "left_D", "right_K", "right_D", "rotation", "translation"),
    "one unnamed": ("camera_matrix", "distortion_coefficients", "camera_matrix_right",
                    "distortion_coefficients_right", "R", "T"),
    "from zero": ("K_0", "dist_0", "K_1", "dist_1", "R", "T"),
}  # fmt: skip


def check(rig):
    points = np.array([[0.3, 0.2, 1.0], [-0.3, -0.2, 1.0]])
    for camera in "LR":
        np.testing.assert_allclose(rig.lens(camera).project(points), RIG.lens(camera).project(points), atol=1e-6)
    np.testing.assert_allclose(rig.left_from_right.matrix, RIG.left_from_right.matrix, atol=1e-9)
    assert (rig.right.width, rig.right.height) == SIZE


@pytest.mark.parametrize("names", SPELLINGS.values(), ids=SPELLINGS)
@pytest.mark.parametrize("name", ["a.yaml", "a.yml"])
def test_a_rig_of_opencv_is_read_in_every_spelling(tmp_path, names, name):
    values = MATRIX[0], TERMS, MATRIX[1], TERMS, MOTION.rotation, MOTION.translation[:, None]
    opencv_file(tmp_path / name, dict(zip(names, values, strict=True)))
    check(read_calibration(tmp_path / name, other_site()))


def test_a_rig_of_ros_has_a_section_per_camera(tmp_path):
    def camera(matrix):
        return {
            "image_width": 640, "image_height": 480, "camera_name": "x", "distortion_model": "plumb_bob",
            "camera_matrix": FLAT | {"data": matrix.ravel().tolist()},
            "distortion_coefficients": {"rows": 1, "cols": 5, "data": TERMS.tolist()},
            "rectification_matrix": FLAT | {"data": np.eye(3).ravel().tolist()},
        }  # fmt: skip

    motion = {"R": MOTION.rotation.tolist(), "T": MOTION.translation.tolist()}
    content = {"left": camera(MATRIX[0]), "right": camera(MATRIX[1]), "extrinsics": motion}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(content | motion))
    with pytest.raises(FormatError, match="expected one of them"):  # R and extrinsics_R
        read_calibration(tmp_path / "a.yaml", other_site())
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"left": content["left"], "right": content["right"]} | motion))
    check(read_calibration(tmp_path / "a.yaml", other_site()))


def kalibr(**changes):
    def camera(matrix):
        return {
            "camera_model": "pinhole", "distortion_model": "radtan", "resolution": list(SIZE),
            "distortion_coeffs": TERMS[:4].tolist(), "intrinsics": matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(),
            "rostopic": "/cam/image_raw",
        }  # fmt: skip

    content = {"cam0": camera(MATRIX[0]), "cam1": camera(MATRIX[1]) | {"T_cn_cnm1": MOTION.matrix.tolist()}}
    for name, change in changes.items():
        content[name] |= change
    return content


def test_a_camchain_of_kalibr_is_read(tmp_path):
    (tmp_path / "camchain.yaml").write_text(yaml.safe_dump(kalibr()))
    check(read_calibration(tmp_path / "camchain.yaml", other_site()))


@pytest.mark.parametrize("posed", [1, 2])
def test_a_rig_of_colmap_is_read_as_polarsim_writes_it(tmp_path, posed):
    poses = [camera_pose(np.array([3.0, -0.3, 1.2]), np.pi, 0.4, 0.02), camera_pose(np.array([0.0, 3, 1]), -1.5, 0.3)]
    colmap.write_model(tmp_path / "model", {"AB"[n]: LocalisedRig(RIG, poses[n]) for n in range(posed)})
    check(read_calibration(tmp_path / "model/cameras.txt", other_site()))


MODELS = {
    "SIMPLE_PINHOLE": ("620 322 238", (0, 0, 0, 0, 0)),
    "PINHOLE": ("620 620 322 238", (0, 0, 0, 0, 0)),
    "SIMPLE_RADIAL": ("620 322 238 -0.05", (-0.05, 0, 0, 0, 0)),
    "RADIAL": ("620 322 238 -0.05 0.02", (-0.05, 0.02, 0, 0, 0)),
    "OPENCV": ("620 620 322 238 -0.05 0.02 1e-4 -2e-4", (-0.05, 0.02, 1e-4, -2e-4, 0)),
    "FULL_OPENCV": ("620 620 322 238 -0.05 0.02 1e-4 -2e-4 0.3 0 0 0", (-0.05, 0.02, 1e-4, -2e-4, 0.3)),
}


@pytest.mark.parametrize(("model", "expected"), list(MODELS.items()))
def test_every_model_of_colmap_with_brown_distortion_is_read(tmp_path, model, expected):
    (tmp_path / "cameras.txt").write_text(f"# comment\n1 {model} 640 480 {expected[0]}\n")
    rig = read_calibration(tmp_path / "cameras.txt", one_camera())
    assert not rig.is_stereo
    assert (rig.left.fx, rig.left.fy, rig.left.cx, rig.left.cy) == (620, 620, 322, 238)
    assert rig.left.distortion == expected[1]


def test_a_single_camera_of_opencv_suffices_for_a_site_with_one_camera(tmp_path):
    opencv_file(tmp_path / "a.yaml", {"camera_matrix": MATRIX[0], "distortion_coefficients": TERMS})
    assert read_calibration(tmp_path / "a.yaml", one_camera()).left == RIG.left
    with pytest.raises(FormatError, match="second camera"):
        read_calibration(tmp_path / "a.yaml", other_site())


def broken(name):
    """Return the name and the text of an invalid file."""
    if name == "equidistant":
        return "a.yaml", yaml.safe_dump(kalibr(cam0={"distortion_model": "equidistant"}))
    if name == "another size":
        return "a.yaml", yaml.safe_dump(kalibr(cam1={"resolution": [1280, 960]}))
    if name == "millimetres":
        matrix = MOTION.matrix.copy()
        matrix[:3, 3] *= 1000
        return "a.yaml", yaml.safe_dump(kalibr(cam1={"T_cn_cnm1": matrix.tolist()}))
    if name == "exchanged":
        return "a.yaml", yaml.safe_dump(kalibr(cam1={"T_cn_cnm1": RIG.left_from_right.matrix.tolist()}))
    if name == "no rotation":
        return "a.yaml", yaml.safe_dump(kalibr(cam1={"T_cn_cnm1": np.diag([2.0, 1, 1, 1]).tolist()}))
    if name == "missing intrinsics":
        content = kalibr()
        del content["cam0"]["intrinsics"]
        return "a.yaml", yaml.safe_dump(content)
    if name == "six terms":
        return "cameras.txt", "1 FULL_OPENCV 640 480 620 620 322 238 0 0 0 0 0 0.1 0 0\n"
    return {
        "fisheye of COLMAP": ("cameras.txt", "1 OPENCV_FISHEYE 640 480 620 620 322 238 0 0 0 0\n"),
        "too few numbers": ("cameras.txt", "1 PINHOLE 640 480 620 620 322\n"),
        "no images.txt": ("cameras.txt", "1 PINHOLE 640 480 620 620 322 238\n2 PINHOLE 640 480 620 620 322 238\n"),
        "text": ("a.yaml", "hello\n"),
        "other keys": ("a.yaml", "a: 1\nb: [1, 2]\n"),
        "no YAML": ("a.yaml", "a: [1\n"),
        "words": ("a.yaml", "camera_matrix: [a, b]\n"),
    }[name]


@pytest.mark.parametrize(
    ("name", "named"),
    [("equidistant", "cam0.distortion_model"), ("another size", "cam1.intrinsics"), ("millimetres", "millimetres"),
     ("exchanged", "exchanged"), ("no rotation", ""), ("missing intrinsics", "cam0.intrinsics"),
     ("six terms", "terms after k3"), ("fisheye of COLMAP", "OPENCV_FISHEYE"), ("too few numbers", "parameters"),
     ("no images.txt", "images.txt"), ("text", "Kalibr"), ("other keys", "camera_matrix"), ("no YAML", ""),
     ("words", "camera_matrix")],
)  # fmt: skip
def test_an_invalid_calibration_is_a_one_line_error_with_the_file(tmp_path, name, named):
    file, text = broken(name)
    (tmp_path / file).write_text(text)
    with pytest.raises(FormatError) as caught:
        read_calibration(tmp_path / file, one_camera() if "terms" in name or "COLMAP" in name else other_site())
    assert str(tmp_path) in str(caught.value)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_site_without_calibration_is_an_error_with_the_remedy():
    with pytest.raises(ConfigError, match=r"cameras\.calibration"):
        stated_rig(other_site())


def test_the_calibration_of_a_site_is_the_prior_of_its_terrains(tmp_path):
    (tmp_path / "camchain.yaml").write_text(yaml.safe_dump(kalibr()))
    cameras = {"stereo": True, "baseline_m": [0.1, 0.15], "calibration": tmp_path / "camchain.yaml"}
    check(stated_rig(other_site(cameras=cameras)))

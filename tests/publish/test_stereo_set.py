import cv2
import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.photo import PhotoKey
from polarsim.publish.stereo_set import DISPARITIES, disparity_picture, kitti_object, rectified_edges
from tests.publish.tiny import ROCK_PLACES, SIZE
from tests.support.kitti import disparity_of, read_calibration, read_objects


def pairs(folder, domain):
    table = pd.read_csv(folder / domain / "keys.csv", dtype={"name": str})
    return [(row["name"], PhotoKey.parse(row["left"])) for row in table.to_dict("records")]


def test_every_pair_has_all_files_of_the_devkit(published, catalogue):
    folder = published("kitti")
    for domain in catalogue.domains:
        names = {name for name, _ in pairs(folder, domain)}
        assert len(names) == 2
        pictures = ("image_2", "image_3", "disp_noc_0", "disp_occ_0")
        for place, suffix in [*((name, "png") for name in pictures), ("label_2", "txt"), ("calib", "txt")]:
            assert {path.name for path in (folder / domain / "training" / place).iterdir()} == {
                f"{name}.{suffix}" for name in names
            }
        listed = [line for path in (folder / domain / "ImageSets").iterdir() for line in path.read_text().split()]
        assert sorted(listed) == sorted(names)
        assert png.read_png(folder / domain / "training/image_2/000000.png").shape == SIZE[::-1]


def test_points_of_the_sandbox_are_projected_as_opencv_rectifies_them(published, catalogue):
    localised = catalogue.terrains[1].rigs["A"]
    points = np.array([[0.2, 0.1, 0.1], [-0.3, -0.2, 0.2], [0.5, 0.4, 0.0]])
    found = read_calibration(published("kitti") / "analog/training/calib/000000.txt")
    places = {}
    for camera, name in (("L", "P2"), ("R", "P3")):
        rectified = found["R0_rect"] @ (found["Tr_velo_to_cam"] @ np.c_[points, np.ones(3)].T)
        image = found[name] @ np.vstack([rectified, np.ones(3)])
        places[camera] = (image[:2] / image[2]).T
    right_from_left = localised.rig.left_from_right.inverse()
    matrices = [localised.rig.left.opencv_matrix(), localised.rig.right.opencv_matrix()]
    terms = [np.array(localised.rig.left.distortion), np.array(localised.rig.right.distortion)]
    turns = cv2.stereoRectify(
        matrices[0], terms[0], matrices[1], terms[1], SIZE, right_from_left.rotation,
        right_from_left.translation[:, None], flags=cv2.CALIB_ZERO_DISPARITY, alpha=0,
    )  # fmt: skip
    for side, camera in enumerate("LR"):
        pixels = localised.project(camera, points) - 0.5
        wanted = cv2.undistortPoints(
            pixels, matrices[side], terms[side], R=turns[side], P=turns[2 + side], criteria=None
        )
        np.testing.assert_allclose(places[camera], wanted.reshape(-1, 2), atol=0.01, rtol=0)
    np.testing.assert_allclose(places["L"][:, 1], places["R"][:, 1], atol=1e-6)  # same rows


def test_boxes_contain_the_rectified_box_to_a_hundredth_of_a_pixel(published, catalogue):
    from polarsim.detect.stereo.rectify import rectify

    folder, localised = published("kitti"), catalogue.terrains[1].rigs["A"]
    turned = rectify(localised.rig, 1.0)
    left = {one.key: one for one in catalogue.of_domain("hapke")}
    for name, key in pairs(folder, "hapke"):
        found = read_objects(folder / f"hapke/training/label_2/{name}.txt")
        labels = catalogue.labels(left[key])
        assert [kind for kind, *_ in found] == [label.kind.capitalize() for label in labels]
        assert [occluded for *_, occluded in found] == [0, 1, 3, 3, 0]
        for (_, box, *_), label in zip(found, labels, strict=True):
            corners = rectified_edges(label.box, localised.rig.left, turned)
            middle = cv2.undistortPoints(  # the centre of the box, rectified by OpenCV, is inside the box read back
                (label.box.reshape(2, 2).mean(axis=0) - 0.5)[None],
                localised.rig.left.opencv_matrix(),
                np.array(localised.rig.left.distortion),
                R=turned.left_from_rectified.rotation.T,
                P=turned.lens.opencv_matrix(),
            ).ravel()
            np.testing.assert_allclose(box.reshape(2, 2).mean(axis=0) - 0.5, middle, atol=0.3)
            np.testing.assert_allclose(box, [*corners.min(axis=0), *corners.max(axis=0)], atol=0.01, rtol=0)
            again = kitti_object(label, localised.rig, turned, left[key])
            assert again.truncated == 0


def test_points_from_disparity_and_calibration_are_on_the_meshes(published):
    """Convention of the devkit: depth = focal length * baseline / disparity, integer coordinates at pixel centres."""
    training = published("kitti") / "hapke/training"
    found = read_calibration(training / "calib/000000.txt")
    everywhere, shared = (disparity_of(png.read_png(training / name / "000000.png")) for name in DISPARITIES[::-1])
    assert everywhere.shape == SIZE[::-1]
    assert 0.5 < np.isfinite(shared).mean() < np.isfinite(everywhere).mean()
    np.testing.assert_array_equal(shared[np.isfinite(shared)], everywhere[np.isfinite(shared)])
    row, column = np.nonzero(np.isfinite(everywhere))
    focal, baseline = found["P2"][0, 0], -found["P3"][0, 3] / found["P2"][0, 0]
    depth = focal * baseline / everywhere[row, column]
    centre = found["P2"][:2, 2]
    camera = np.c_[(np.c_[column, row] - centre) / focal, np.ones(len(row))] * depth[:, None]
    laser = np.vstack([found["Tr_velo_to_cam"], [0, 0, 0, 1]])
    points = (np.linalg.inv(laser) @ np.c_[camera, np.ones(len(row))].T)[:3].T
    near = np.min([np.linalg.norm(points - [x, y, r / 2], axis=1) - r for x, y, r in ROCK_PLACES.values()], axis=0)
    surface = np.minimum(np.abs(points[:, 2]), np.abs(near))
    assert (
        np.quantile(surface, 0.99) < 0.006
    )  # the disparity resolution corresponds to millimetres; spheres have flat faces
    assert (near < 0.004).sum() > 200  # points on rocks


def test_disparities_outside_the_range_of_kitti_are_0():
    steps = disparity_picture(np.array([[np.nan, 0.001, 1.5, 255.99, 256.0, 400.0]]))
    assert steps.tolist() == [[0, 0, 384, 65533, 0, 0]]
    np.testing.assert_array_equal(disparity_of(steps)[0, :3], [np.nan, np.nan, 1.5])

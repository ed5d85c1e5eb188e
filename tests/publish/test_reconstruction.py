import json

import numpy as np
import pycolmap
import trimesh

from polarsim.formats import png
from polarsim.geometry.poses import Pose
from polarsim.publish.reconstruction import CV_FROM_GL, POINTS
from tests.publish.tiny import ROCK_PLACES, SIZE

PLACE = np.array([0.2, 0.1, 0.05])  # in the photos


def test_colmap_reads_poses_lenses_and_names(published, catalogue):
    for domain in catalogue.domains:
        folder = published("colmap") / domain / "Terrain01"
        model = pycolmap.Reconstruction(folder / "sparse/0")
        images = {image.name: image for image in model.images.values()}
        assert set(images) == {f"{one.key}.png" for one in catalogue.of_domain(domain)}
        for one in catalogue.of_domain(domain):
            image, camera = images[f"{one.key}.png"], catalogue.camera(one)
            sandbox_from_camera = Pose.from_matrix(image.cam_from_world().matrix()).inverse()
            np.testing.assert_allclose(sandbox_from_camera.matrix, camera.world_from_camera.matrix, atol=1e-9, rtol=0)
            np.testing.assert_allclose(image.project_point(PLACE), camera.project(PLACE), atol=1e-9, rtol=1e-12)
            assert png.read_png(folder / "images" / image.name).shape == SIZE[::-1]
        assert len(model.rigs) == 1
        assert len(model.frames) == 2
        assert abs(len(model.points3D) - POINTS) < 300


def test_nerfstudio_poses_are_those_of_the_cameras(published, catalogue):
    for domain in catalogue.domains:
        folder = published("nerfstudio") / domain / "Terrain01"
        content = json.loads((folder / "transforms.json").read_text())
        frames = {frame["file_path"]: frame for frame in content["frames"]}
        for one in catalogue.of_domain(domain):
            frame, camera = frames[f"images/{one.key}.png"], catalogue.camera(one)
            lens = camera.lens
            pose = frame["transform_matrix"] @ CV_FROM_GL
            np.testing.assert_allclose(pose, camera.world_from_camera.matrix, atol=1e-9, rtol=0)
            assert [frame[name] for name in ("fl_x", "fl_y", "cx", "cy")] == [lens.fx, lens.fy, lens.cx, lens.cy]
            assert tuple(frame[name] for name in ("k1", "k2", "p1", "p2", "k3")) == lens.distortion
            # OpenGL: points in front of the camera have negative z, points above the centre have positive y.
            gl_from_sandbox = np.linalg.inv(frame["transform_matrix"])
            x, y, z, _ = gl_from_sandbox @ [*PLACE, 1]
            pinhole = np.array([lens.fx * x / -z + lens.cx, lens.fy * -y / -z + lens.cy])
            assert z < 0
            assert np.abs(pinhole - camera.project(PLACE)).max() < 5  # without lens distortion
        points = trimesh.load(folder / content["ply_file_path"])
        assert len(points.colors) == len(points.vertices)


def test_points_of_the_cloud_are_on_the_meshes(published):
    points = trimesh.load(published("nerfstudio") / "hapke/Terrain01/points.ply").vertices
    on_ground = np.abs(points[:, 2]) < 1e-4
    assert on_ground.sum() > 50_000
    x, y, radius = ROCK_PLACES[4]
    distance = np.linalg.norm(points - [x, y, radius / 2], axis=1)
    assert ((distance > 0.9 * radius) & (distance < 1.001 * radius)).sum() > 100

import numpy as np
import open3d
import pytest

from polarsim.errors import FormatError
from polarsim.formats import ply
from polarsim.formats.ply import Cloud


def cloud_of(rng, count):
    normals = rng.normal(size=(count, 3))
    return Cloud(rng.normal(size=(count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True))


@pytest.mark.parametrize("count", [0, 1, 500])
def test_a_cloud_reads_back(rng, tmp_path, count):
    cloud = cloud_of(rng, count)
    ply.write_ply(tmp_path / "rock1.ply", cloud)
    back = ply.read_ply(tmp_path / "rock1.ply")
    np.testing.assert_allclose(back.points, cloud.points, rtol=1e-6)  # float32
    np.testing.assert_allclose(back.normals, cloud.normals, atol=1e-6)
    assert back.points.shape == (count, 3)


def test_open3d_reads_the_same_points_and_normals(rng, tmp_path):
    cloud = cloud_of(rng, 40)
    ply.write_ply(tmp_path / "rock1.ply", cloud)
    read = open3d.io.read_point_cloud(str(tmp_path / "rock1.ply"))
    np.testing.assert_allclose(np.asarray(read.points), cloud.points, rtol=1e-6)
    np.testing.assert_allclose(np.asarray(read.normals), cloud.normals, atol=1e-6)


def test_a_truncated_file_is_an_error(rng, tmp_path):
    path = tmp_path / "rock1.ply"
    ply.write_ply(path, cloud_of(rng, 10))
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(FormatError, match=r"rock1\.ply"):
        ply.read_ply(path)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nend_header\n",
    ],
)
def test_other_files_are_errors(tmp_path, content):
    path = tmp_path / "rock1.ply"
    path.write_bytes(content)
    with pytest.raises(FormatError):
        ply.read_ply(path)


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(FormatError, match=r"rock9\.ply"):
        ply.read_ply(tmp_path / "rock9.ply")


def test_a_value_that_is_not_finite_is_an_error(rng, tmp_path):
    cloud = cloud_of(rng, 3)
    cloud.points[1, 2] = np.nan
    ply.write_ply(tmp_path / "rock1.ply", cloud)
    with pytest.raises(FormatError):
        ply.read_ply(tmp_path / "rock1.ply")

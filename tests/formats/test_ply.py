import numpy as np
import open3d
import pytest

from polarsim.errors import FormatError
from polarsim.formats import ply
from polarsim.formats.ply import Cloud


@pytest.mark.parametrize("count", [0, 1, 500])
def test_a_cloud_reads_back_and_open3d_reads_the_same(rng, tmp_path, count):
    normals = rng.normal(size=(count, 3))
    cloud = Cloud(rng.normal(size=(count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True))
    ply.write_ply(tmp_path / "rock1.ply", cloud)
    found = open3d.io.read_point_cloud(str(tmp_path / "rock1.ply"))
    back = ply.read_ply(tmp_path / "rock1.ply")
    for points, normals in ((back.points, back.normals), (np.asarray(found.points), np.asarray(found.normals))):
        np.testing.assert_allclose(points, cloud.points, rtol=1e-6)  # float32
        np.testing.assert_allclose(normals, cloud.normals, atol=1e-6)
        assert points.shape == (count, 3)


HEADER = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
PROPERTIES = b"".join(b"property float %s\n" % name for name in (b"x", b"y", b"z", b"nx", b"ny", b"nz"))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n",
        HEADER + b"property float x\nend_header\n" + bytes(4),
        HEADER + PROPERTIES + b"end_header\n" + bytes(23),  # truncated
        HEADER + PROPERTIES + b"end_header\n" + bytes(20) + np.float32(np.nan).tobytes(),
    ],
)
def test_other_files_are_errors(tmp_path, content):
    path = tmp_path / "rock1.ply"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"rock1\.ply"):
        ply.read_ply(path)

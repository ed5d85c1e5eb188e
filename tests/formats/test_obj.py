import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from polarsim.errors import FormatError
from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh

TETRAHEDRON = Mesh(
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)
PLAIN = "o rock\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"


def read_text(tmp_path, text):
    path = tmp_path / "rock.obj"
    path.write_text(text)
    return obj.read(path)


@settings(deadline=None)  # the first file that is read loads pandas
@given(
    vertices=arrays.arrays(float, (5, 3), elements=st.floats(-9, 9)),
    faces=arrays.arrays(np.int64, st.tuples(st.integers(1, 9), st.just(3)), elements=st.integers(0, 4)),
)
def test_a_written_mesh_comes_back_to_a_micrometre(tmp_path_factory, vertices, faces):
    path = tmp_path_factory.mktemp("obj") / "rock.obj"
    obj.write(path, Mesh(vertices, faces), "rock")
    back = obj.read(path)
    np.testing.assert_allclose(back.vertices, vertices, atol=5.1e-7)
    np.testing.assert_array_equal(back.faces, faces)


def test_trimesh_reads_the_same_triangles(tmp_path):
    obj.write(tmp_path / "rock.obj", TETRAHEDRON, "rock")
    other = trimesh.load(tmp_path / "rock.obj", process=False)
    np.testing.assert_allclose(other.triangles, TETRAHEDRON.vertices[TETRAHEDRON.faces])
    assert other.volume == pytest.approx(1 / 6)


@pytest.mark.parametrize(
    "faces",
    ["f 1 2 3\nf 2 4 3\n", "f 1//1 2//2 3//3\nf 2//2 4//4 3//3\n", "f 1/7/1 2/8/2 3/9/3\nf 2/1/2 4/1/4 3/1/3\n"],
)
def test_faces_may_name_texture_and_normals(tmp_path, faces):
    np.testing.assert_array_equal(read_text(tmp_path, PLAIN + faces).faces, [[0, 1, 2], [1, 3, 2]])


@pytest.mark.parametrize(
    "faces", ["f 1 2 4 3\n", "f -4 -3 -1 -2\n", "l 1 2\nf 1//1 2//1 4//1\nl 2 3\nf 1//1 4//1 3//1\n"]
)
def test_quads_relative_numbers_and_stray_lines_are_read(tmp_path, faces):
    np.testing.assert_array_equal(read_text(tmp_path, PLAIN + faces).faces, [[0, 1, 3], [0, 3, 2]])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (PLAIN, "no triangle"),
        (PLAIN + "f 1 2 9\n", "names vertex 9 of 4"),
        (PLAIN + "f 1 2 0\n", "names vertex"),
        (PLAIN + "f 1 2 three\n", r"rock.obj:6: .*three"),
        (PLAIN + "f 1 2 3.5\n", r"rock.obj:6: .*3.5"),
        ("v 0 0\n" + PLAIN + "f 1 2 3\n", r"rock.obj:1: "),
        (PLAIN + "v nan 0 0\nf 1 2 3\n", "not finite"),
    ],
)
def test_a_broken_file_is_refused_with_position_and_reason(tmp_path, text, reason):
    with pytest.raises(FormatError, match=reason):
        read_text(tmp_path, text)


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(FormatError, match=r"terrain01_rock1\.obj"):
        obj.read(tmp_path / "terrain01_rock1.obj")


@pytest.mark.release
def test_the_quick_reader_obeys_the_one_that_reads_line_by_line(release_root):
    paths = sorted((release_root / "TerrainMeshes" / "Terrain11").glob("*.obj"))
    quick = [path for path in paths if obj._plain_triangles(path.read_bytes()) is not None]
    assert quick
    for path in quick[:4]:
        slow = obj._any_faces(path, path.read_bytes())
        np.testing.assert_array_equal(obj.read(path).vertices, slow.vertices)
        np.testing.assert_array_equal(obj.read(path).faces, slow.faces)


def test_the_full_mesh_stands_before_its_decimated_copy(tmp_path):
    for name in (
        "terrain04_rock2_decimate-005.obj",
        "terrain04_rock2.obj",
        "terrain04_rock10_decimate-005.obj",
        "x.obj",
    ):
        (tmp_path / name).touch()
    assert {rock: path.name for rock, path in obj.rock_files(tmp_path).items()} == {
        2: "terrain04_rock2.obj",
        10: "terrain04_rock10_decimate-005.obj",
    }


def test_a_name_tells_terrain_rock_and_copy():
    assert obj.parse_rock_name(obj.rock_name(4, 12, decimated=True)) == (4, 12, True)
    assert obj.parse_rock_name("terrain01_ground.obj") is None


def test_normals_of_an_outward_mesh_point_outward():
    offset = TETRAHEDRON.vertices - TETRAHEDRON.vertices.mean(axis=0)
    assert ((TETRAHEDRON.normals() * offset).sum(axis=1) > 0).all()


@pytest.mark.parametrize("faces", ["f 1 2  3\n", "f 1 2 3 \n", "f 1/7/1 2//2 3//3\nf 2//2 4 3\n", "f +1 2 3\n"])
def test_what_the_quick_reader_does_not_know_is_read_line_by_line(tmp_path, faces):
    np.testing.assert_array_equal(read_text(tmp_path, PLAIN + faces).faces[0], [0, 1, 2])

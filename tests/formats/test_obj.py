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


@pytest.fixture(autouse=True, scope="module", params=["arrow", "numpy"])
def columns(request):
    """Read blocks of numbers with Arrow, or as installations without pyarrow do."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "numpy":
            patch.setattr(obj, "_columns", obj._columns_numpy)
        yield


PLAIN = "o rock\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"


def read_text(tmp_path, text):
    path = tmp_path / "rock.obj"
    path.write_text(text)
    return obj.read_obj(path)


@settings(deadline=None)  # the first file that is read loads pandas
@given(
    vertices=arrays.arrays(float, (5, 3), elements=st.floats(-9, 9)),
    faces=arrays.arrays(np.int64, st.tuples(st.integers(1, 9), st.just(3)), elements=st.integers(0, 4)),
)
def test_a_mesh_reads_back_with_an_error_below_a_micrometre(tmp_path_factory, vertices, faces):
    path = tmp_path_factory.mktemp("obj") / "rock.obj"
    obj.write_obj(path, Mesh(vertices, faces), "rock")
    back = obj.read_obj(path)
    np.testing.assert_allclose(back.vertices, vertices, atol=5.1e-7)
    np.testing.assert_array_equal(back.faces, faces)


def test_trimesh_reads_the_same_triangles(tmp_path):
    obj.write_obj(tmp_path / "rock.obj", TETRAHEDRON, "rock")
    other = trimesh.load(tmp_path / "rock.obj", process=False)
    np.testing.assert_allclose(other.triangles, TETRAHEDRON.vertices[TETRAHEDRON.faces])
    assert other.volume == pytest.approx(1 / 6)


@pytest.mark.parametrize(
    "faces", ["f 1 2 4 3\n", "f -4 -3 -1 -2\n", "l 1 2\nf 1//1 2//1 4//1\nl 2 3\nf 1//1 4//1 3//1\n"]
)
def test_quads_relative_numbers_and_unknown_lines_are_read(tmp_path, faces):
    np.testing.assert_array_equal(read_text(tmp_path, PLAIN + faces).faces, [[0, 1, 3], [0, 3, 2]])


@st.composite
def spellings(draw):
    """A mesh of triangles and quads, the plain file, and a file with the same content in a different notation."""
    count = draw(st.integers(4, 9))
    vertices = np.array(draw(st.lists(st.tuples(*[st.integers(-99, 99)] * 3), min_size=count, max_size=count)), float)
    corners = st.lists(st.integers(1, count), min_size=3, max_size=4)
    faces = draw(st.lists(corners, min_size=1, max_size=6))
    triangles = [[face[0], face[k], face[k + 1]] for face in faces for k in range(1, len(face) - 1)]
    if draw(st.booleans()):
        faces = triangles
    blank = draw(st.sampled_from([" ", "\t", "  ", " \t "]))
    after_tag = draw(st.sampled_from([" ", "\t", "  ", blank]))
    before = draw(st.sampled_from(["", "", " ", "\t", "   "]))
    after = draw(st.sampled_from(["", "", " ", "\t", " # Fläche"]))
    number = draw(st.sampled_from(["{:g}", "{:+.1f}", "{:e}", "{:.3f}"]))
    corner = draw(st.sampled_from(["{0}", "{0}/1", "{0}//1", "{0}/1/1"]))
    beyond = draw(st.sampled_from([[], ["1.0"], ["0.5", "0.4", "0.3"]])) if blank == " " or draw(st.booleans()) else []
    negative, continued = draw(st.booleans()), draw(st.booleans())

    def line(tag, fields):
        middle = f"{blank}\\\n{blank}" if continued else blank
        return f"{before}{tag}{after_tag}{blank.join(fields[:2])}{middle}{blank.join(fields[2:])}{after}\n"

    lines = [line("v", [*(number.format(value) for value in row), *beyond]) for row in vertices]
    others = draw(st.sampled_from(["", "vn 0 0 1\nvt 0 0\n", "g Würfel_1\nusemtl föhn\ns off\n", "\n\n# v 9 9 9\n"]))
    ends = [[corner.format(c - count - 1 if negative else c) for c in face] for face in faces]
    text = others + "".join(lines) + others + "".join(line("f", fields) for fields in ends) + others
    if draw(st.booleans()):
        text = text.removesuffix("\n")
    text = text.replace("\n", draw(st.sampled_from(["\n", "\r\n", "\r"])))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1", "utf-32"]))
    plain = "".join("v {:g} {:g} {:g}\n".format(*row) for row in vertices)
    plain += "".join("f {} {} {}\n".format(*row) for row in triangles)
    return f"o rock\n{plain}".encode(), text.encode(encoding)


@settings(deadline=None, max_examples=60)
@given(files=spellings())
def test_all_notations_of_a_mesh_give_the_same_mesh(tmp_path_factory, files):
    folder = tmp_path_factory.getbasetemp()
    meshes = []
    for name, content in zip(("plain", "other"), files, strict=True):
        (folder / f"{name}.obj").write_bytes(content)
        meshes.append(obj.read_obj(folder / f"{name}.obj"))
    assert obj._plain_triangles(files[0]) is not None
    np.testing.assert_array_equal(meshes[1].vertices, meshes[0].vertices)
    np.testing.assert_array_equal(meshes[1].faces, meshes[0].faces)


LINES = (
    *("v 0 0 0", "v 1 0 0", "v\t0 1 0", " v 5 5 5", "v 1_0 0 0", "v 2 2 2 # b", "vn 0 0 1", "# a", "o x\r", "3"),
    *("f 1 2 3", "f\t1 2 3", " f 1 2 3", "f 0 1 2", "f 1 2 \\", "f -1 -2 -3", "f 0x1 2 3", "f 1/1 2/1 3/1", "f 4 2 3"),
)


@settings(deadline=None, max_examples=60)
@given(lines=st.lists(st.sampled_from(LINES), min_size=3, max_size=12), first=st.booleans())
def test_the_fast_reader_accepts_the_files_of_the_reference(lines, first):
    """Plain blocks of vertices and triangles with any other lines before, between and after them."""
    half = len(lines) // 2
    blocks = ["v 0 0 1", "v 1 0 1", "v 0 1 1", *lines[half:][:2], "f 1 2 3", "f 2 1 3"]
    content = "\n".join([*lines[:half], *blocks, *(lines[half:] if first else [])]).encode() + b"\n"
    quick = obj._plain_triangles(content)
    if quick is not None:
        slow = obj._any_faces(content)
        np.testing.assert_array_equal(quick.vertices, slow.vertices)
        np.testing.assert_array_equal(quick.faces, slow.faces)


@pytest.mark.parametrize(
    "text",
    [
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\nv 9 9 9\nv 8 8 8\n",
        PLAIN + "f 1 2 -5\n",
        PLAIN + "f 1 2 3_0\n",
        "v 0,0 0,0 0,0\n" + PLAIN + "f 1 2 3\n",
        PLAIN,
        PLAIN + "f 1 2 9\n",
        PLAIN + "f 1 2 0\n",
        PLAIN + "f 1 2 three\n",
        PLAIN + "f 1 2 3.5\n",
        "v 0 0\n" + PLAIN + "f 1 2 3\n",
        PLAIN + "v nan 0 0\nf 1 2 3\n",
    ],
)
def test_an_invalid_file_is_an_error_with_line_and_reason(tmp_path, text):
    with pytest.raises(FormatError):
        read_text(tmp_path, text)


def test_the_full_mesh_is_preferred_to_the_decimated_mesh(tmp_path):
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


def test_a_name_has_terrain_rock_and_decimation():
    assert obj.parse_rock_name(obj.rock_name(4, 12, decimated=True)) == (4, 12, True)
    assert obj.parse_rock_name("terrain01_ground.obj") is None


@pytest.mark.parametrize("faces", ["f 1 2  3\n", "f 1 2 3 \n", "f 1/7/1 2//2 3//3\nf 2//2 4 3\n", "f +1 2 3\n"])
def test_files_that_the_fast_reader_does_not_support_are_read_line_by_line(tmp_path, faces):
    np.testing.assert_array_equal(read_text(tmp_path, PLAIN + faces).faces[0], [0, 1, 2])

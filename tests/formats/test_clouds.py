import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats.clouds import read_cloud, write_cloud
from polarsim.formats.nasa import MM


@pytest.mark.parametrize("name", ["a.xyz", "b.txt", "c.pts"])
def test_a_cloud_reads_back_with_an_error_below_a_twentieth_of_a_millimetre(tmp_path, rng, name):
    points = rng.normal(0, 3, (200, 3))
    write_cloud(tmp_path / name, points, rng.integers(0, 255, 200))
    np.testing.assert_allclose(read_cloud(tmp_path / name), points, atol=0.5e-4 + 1e-9)


@st.composite
def clouds(draw):
    """Points in millimetres, and a text file of the points in any notation of common programs."""
    points = draw(st.lists(st.tuples(*[st.integers(-90_000, 90_000)] * 3), min_size=1, max_size=8))
    comma = draw(st.booleans())
    separator = draw(st.sampled_from([" ", "\t", ";", "; ", "   "] + ([] if comma else [",", ", "])))
    form = draw(st.sampled_from(["{:.2f}", "{:.4e}", "{:+.3f}"]))
    beyond = draw(st.sampled_from([[], ["17"], ["0.25", "128", "64", "32"]]))
    fields = [[*(form.format(value / 10) for value in point), *beyond] for point in points]
    header = draw(st.sampled_from(["", f"{len(points)}\n", "# Höhe über Grund\n\n", "//X;Y;Z\n"]))
    before = "" if separator.strip() else draw(st.sampled_from(["", "  "]))
    text = header + "".join(f"{before}{separator.join(row)}\n" for row in fields)
    text = text.replace(".", ",") if comma else text
    text = text.replace("\n", draw(st.sampled_from(["\n", "\r\n"])))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]))
    return np.array(points) / 10, text.encode(encoding)


@settings(deadline=None, max_examples=60)
@given(cloud=clouds())
def test_all_notations_of_a_cloud_give_the_same_cloud(tmp_path_factory, cloud):
    path = tmp_path_factory.getbasetemp() / "a.xyz"
    path.write_bytes(cloud[1])
    np.testing.assert_allclose(read_cloud(path) / MM, cloud[0], rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("row", ["nan 2 3", "1 2 nan", "1 NaN 3"])
def test_points_with_missing_coordinates_are_skipped_and_counted(tmp_path, caplog, row):
    (tmp_path / "a.xyz").write_text(f"1 2 3\n{row}\nnan nan nan\n4 5 6\n")
    np.testing.assert_allclose(read_cloud(tmp_path / "a.xyz") / MM, [[1, 2, 3], [4, 5, 6]])
    assert [line for line in caplog.messages if "1 of 4 points skipped" in line]


@pytest.mark.parametrize(
    ("text", "line"), [("1 2 3\n\n4 5\n", 3), ("x y z\n1 2 3\n4 five 6\n", 3), ("1;2;3\n4;5\n", 2)]
)
def test_an_invalid_line_is_an_error_with_the_line_number(tmp_path, text, line):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(FormatError) as caught:
        read_cloud(tmp_path / "a.xyz")
    assert (caught.value.path, caught.value.line) == (tmp_path / "a.xyz", line)


@pytest.mark.parametrize("name", ["a.pts", "a.txt", "a.xyz"])
def test_a_ptx_file_is_an_error(tmp_path, name):
    header = "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    (tmp_path / name).write_text(f"{header}1 2 3 0.5\n4 5 6 0.5\n")
    with pytest.raises(FormatError):
        read_cloud(tmp_path / name)


def test_a_ply_cloud_is_read_in_millimetres(tmp_path):
    header = (
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    (tmp_path / "a.ply").write_text(header + "1000 2000 3000\n4000 5000 6000\n")
    np.testing.assert_allclose(read_cloud(tmp_path / "a.ply"), [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.xyz", ""), ("a.xyz", "1 2\n3 4\n"), ("a.xyz", "1 2 3\n4 5\n"), ("a.las", "1 2 3\n"),
     ("a.xyz", "nan nan nan\n"), ("a.ply", "ply\nnonsense"), ("a.xyz", "1 2 3\nx y z\n"), ("a.pts", "\x00\x01\x02")],
)  # fmt: skip
def test_a_file_that_is_no_cloud_is_an_error(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(FormatError):
        read_cloud(tmp_path / name)

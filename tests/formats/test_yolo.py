import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats import release, yolo
from tests.support.polar_photos import SIZE

PIXEL_BOXES = st.lists(
    st.tuples(st.integers(0, 1), st.integers(0, 1900), st.integers(0, 1180), st.integers(1, 36), st.integers(1, 36)),
    max_size=20,
)


def boxes_of(rows):
    rows = np.array(rows, float).reshape(-1, 5)
    return rows[:, 0].astype(int), np.concatenate([rows[:, 1:3], rows[:, 1:3] + rows[:, 3:5]], axis=1)


def test_a_line_is_centre_and_extent_over_the_size_of_the_photo(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("1 0.5 0.25 0.1 0.2\n")
    classes, boxes = yolo.read_boxes(path, size=SIZE)
    assert classes.tolist() == [1]
    # 968 -+ 96.8 and 304 -+ 121.6 on a photo of 1936 x 1216
    np.testing.assert_allclose(boxes, [[871.2, 182.4, 1064.8, 425.6]])


@given(rows=PIXEL_BOXES)
def test_whole_pixel_boxes_read_back_to_a_hundredth_of_a_pixel(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("yolo") / "a.txt"
    classes, boxes = boxes_of(rows)
    yolo.write_boxes(path, classes, boxes, size=SIZE)
    read_classes, read_boxes = yolo.read_boxes(path, size=SIZE)
    assert read_classes.tolist() == classes.tolist()
    np.testing.assert_allclose(read_boxes, boxes, atol=0.01)


@pytest.mark.parametrize(
    "line",
    [
        "0 0.5 0.5 0.1",
        "0 0.5 0.5 0.1 0.1 0.9",
        "09_B_off_180_R_00320 0.5 0.5 0.1 0.1",
        "2 0.5 0.5 0.1 0.1",
        "-1 0.5 0.5 0.1 0.1",
        "0.0 0.5 0.5 0.1 0.1",
        "0 0.5 nan 0.1 0.1",
        "0 0.5 inf 0.1 0.1",
        "0 1.5 0.5 0.1 0.1",
        "0 0.5 0.5 0 0.1",
        "0 0.5 0.5 -0.1 0.1",
        "0 0.5 0.5 1.2 0.1",
        "rock 0.5 0.5 0.1 0.1",
    ],
)
def test_an_invalid_line_is_an_error_with_file_line_and_reason(tmp_path, line):
    path = tmp_path / "a.txt"
    path.write_text(f"0 0.5 0.5 0.1 0.1\n\n{line}\n")
    with pytest.raises(FormatError) as caught:
        yolo.read_boxes(path, size=SIZE)
    assert str(caught.value).startswith(f"{path}:3:")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("number", "rest"), [(1, ""), (2, "1 more malformed line"), (7, "6 more malformed lines")])
def test_an_error_counts_further_malformed_lines(tmp_path, number, rest):
    path = tmp_path / "a.txt"
    path.write_text("0 0.5 0.5 0.1 0.1\n" + "0 0.5 0.5\n5 0.5 0.5 0.1 0.1\n" * 4)
    path.write_text("".join(path.read_text().splitlines(keepends=True)[: 1 + number]))
    with pytest.raises(yolo.MalformedLinesError) as caught:
        yolo.read_boxes(path, size=SIZE)
    assert [line.line for line in caught.value.lines] == list(range(2, 2 + number))
    assert caught.value.line == 2
    assert str(caught.value).partition("; ")[2] == rest


@pytest.mark.parametrize("content", [b"\xff\xfe0 0.5", "0 0.5 0.5 0.1 0.１".encode(), b"0 0.5 0.5 0.1 0.1_0"])
def test_bytes_that_are_no_text_or_no_digits_are_errors(tmp_path, content):
    (tmp_path / "a.txt").write_bytes(content)
    with pytest.raises(FormatError, match=r"a\.txt"):
        yolo.read_boxes(tmp_path / "a.txt", size=SIZE)


def test_polygons_read_back(tmp_path):
    path = tmp_path / "a.txt"
    square = np.array([[0, 0], [1936, 0], [1936, 1216], [0, 1216]], float)
    triangle = np.array([[10, 20], [30.5, 20], [30, 44]], float)
    yolo.write_polygons(path, [(3, triangle), (0, square)], size=SIZE)
    (first, vertices), (second, whole) = yolo.read_polygons(path, size=SIZE)
    assert (first, second) == (3, 0)
    np.testing.assert_allclose(vertices, triangle, atol=2e-3)
    np.testing.assert_allclose(whole, square, atol=2e-3)


@pytest.mark.parametrize(
    "line",
    [
        "2 0.1 0.1 0.2 0.2",
        "2 0.1 0.1 0.2 0.2 0.3",
        "4 0.1 0.1 0.2 0.2 0.3 0.1",
        "2 0.1 0.1 0.2 x 0.3 0.1",
    ],
)
def test_an_invalid_polygon_is_an_error_with_file_line_and_reason(tmp_path, line):
    path = tmp_path / "a.txt"
    path.write_text(f"{line}\n")
    with pytest.raises(FormatError) as caught:
        yolo.read_polygons(path, size=SIZE)
    assert str(caught.value).startswith(f"{path}:1:")


@pytest.mark.release
@pytest.mark.parametrize("terrain", [1, 4, 11])  # their files have six decimals throughout
def test_published_boxes_are_written_as_they_were_read(release_root, tmp_path, terrain):
    paths = list(release.label_files(release_root, terrain).values())[::20]
    for path in paths:
        yolo.write_boxes(tmp_path / "copy.txt", *yolo.read_boxes(path, size=SIZE), size=SIZE)
        assert (tmp_path / "copy.txt").read_text() == path.read_text()

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats import class_lists, yolo
from polarsim.formats.release import read_annotated_boxes
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEY = PhotoKey.parse("01_A_off_30_L_0256")
# Boxes: class name, x, y, width, height in pixels of the photo.
DRAWN = st.lists(
    st.tuples(
        st.sampled_from(BOX_CLASSES),
        st.floats(0, 1800),
        st.floats(0, 1100),
        st.floats(1, 130),
        st.floats(1, 110),
    ),
    max_size=12,
)
CLASS_LISTS = st.permutations([*BOX_CLASSES, "dog", "crater"])


def line(number, x, y, width, height):
    """A YOLO line by the format's definition: centre and size over the size of a photo of 1936 x 1216."""
    return f"{number} {(x + width / 2) / 1936:.6f} {(y + height / 2) / 1216:.6f} {width / 1936:.6f} {height / 1216:.6f}"


@settings(max_examples=25)
@given(drawn=DRAWN, names=CLASS_LISTS, newline=st.sampled_from(["\n", "\r\n"]))
def test_classes_are_identified_by_name_for_any_order_and_line_ends(tmp_path_factory, drawn, names, newline):
    folder = tmp_path_factory.mktemp("annotated")
    (folder / "classes.txt").write_bytes("".join(name + newline for name in names).encode())
    lines = [line(names.index(name), *box) for name, *box in drawn]
    (folder / f"{KEY}.txt").write_bytes("".join(text + newline for text in lines).encode())
    classes, boxes = read_annotated_boxes(folder, polar().images.size, PhotoKey.parse)[KEY]
    assert [BOX_CLASSES[number] for number in classes] == [name for name, *_ in drawn]
    wanted = np.array([[x, y, x + width, y + height] for _, x, y, width, height in drawn]).reshape(-1, 4)
    np.testing.assert_allclose(boxes, wanted, atol=0.01)


def test_without_a_class_list_the_order_of_the_release_is_used(tmp_path):
    yolo.write_boxes(tmp_path / f"{KEY}.txt", np.array([0, 1]), np.array([[5, 5, 50, 60]] * 2, float), size=SIZE)
    assert read_annotated_boxes(tmp_path, polar().images.size, PhotoKey.parse)[KEY][0].tolist() == [0, 1]


def test_images_and_copies_are_skipped_and_terrain_folders_have_separate_class_lists(tmp_path, caplog):
    for name in (f"{KEY}.png", "notes.md", f"{KEY} copy.txt"):
        (tmp_path / name).write_text("nothing to read here")
    (tmp_path / f"{KEY}.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    other = tmp_path / "Terrain03"
    other.mkdir()
    (other / "classes.txt").write_text("shadow\nrock")
    (other / "03_A_off_30_L_0256.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    found = read_annotated_boxes(tmp_path, polar().images.size, PhotoKey.parse)
    assert {str(key): classes.tolist() for key, (classes, _) in found.items()} == {
        "01_A_off_30_L_0256": [0],
        "03_A_off_30_L_0256": [1],
    }
    assert "copy.txt" in caplog.text
    assert "notes.md" not in caplog.text


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ("rock\nshadow\n", "0 0.5 0.5 0.1 0.1\n0 0.5 0.5 0.1\n"),
        ("rock\nshadow\n", "0 0.5 0.5 0.1 0.1 0.9\n"),
        ("rock\nshadow\n", "2 0.5 0.5 0.1 0.1\n"),
        ("dog\nrock\nshadow\n", "1 0.5 0.5 0.1 0.1\n0 0.5 0.5 0.1 0.1\n"),
        ("rock\nshadow\n", "rock 0.5 0.5 0.1 0.1\n"),
        ("\n", "0 0.5 0.5 0.1 0.1\n"),
        ("rock\nrock\n", "0 0.5 0.5 0.1 0.1\n"),
    ],
)
def test_an_invalid_file_is_a_one_line_error(tmp_path, names, text):
    (tmp_path / "classes.txt").write_text(names)
    (tmp_path / f"{KEY}.txt").write_text(text)
    with pytest.raises(FormatError) as caught:
        read_annotated_boxes(tmp_path, polar().images.size, PhotoKey.parse)
    assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(FormatError):
        read_annotated_boxes(tmp_path / "nowhere", polar().images.size, PhotoKey.parse)


def test_an_empty_line_between_names_is_a_class_without_a_name(tmp_path):
    (tmp_path / "classes.txt").write_text("rock\n\nshadow\n\n")
    assert class_lists.class_names(tmp_path) == ("rock", "", "shadow")

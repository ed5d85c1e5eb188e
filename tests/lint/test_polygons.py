import numpy as np
import pytest

from polarsim.lint.files import file_defects, other_camera, polygon_box_mismatches, ring_defects
from polarsim.photo import PhotoKey

BACKGROUND, GROUND, ROCK, SHADOW = range(4)
SIZE = (1936, 1216)
KEY = PhotoKey.parse("11_A_off_30_L_2048")


def square(x, y, side=60):
    return np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]], float)


PHOTO = np.array([[0, 0], [1936, 0], [1936, 1216], [0, 1216]], float)
SOUND = [(GROUND, PHOTO), (ROCK, square(100, 100)), (SHADOW, square(160, 110))]


@pytest.mark.parametrize(
    ("ring", "defects"),
    [
        ([[0, 0], [50, 50], [50, 0], [0, 40]], ["invalid_ring"]),  # crosses itself
        ([[10, 10], [12, 10], [12, 13], [10, 13]], ["tiny_polygon"]),
        ([[10, 10], [90, 10], [90, 11], [10, 11]], ["thin_polygon"]),
        ([[1900, 10], [1940, 10], [1940, 90], [1900, 90]], ["out_of_photo"]),
        ([[10, 10], [90, 10], [90, 80]], ["triangle"]),
        ([[0, 0], [1936, 0], [1936, 1216], [0, 1216]], []),
    ],
)
def test_defects_of_polygons_are_found(ring, defects):
    found = list(ring_defects([*SOUND, (ROCK, np.array(ring, float))], SIZE))
    assert [defect.name for defect in found] == defects
    assert all(defect.rows == (3,) for defect in found)


def names(polygons):
    return [defect.name for defect in file_defects(polygons, SIZE)]


@pytest.mark.parametrize(
    ("polygons", "found"),
    [
        (SOUND, []),
        ([], []),
        ([(ROCK, PHOTO), SOUND[2]], ["no_ground", "ground_as_rock"]),
        ([(BACKGROUND, PHOTO), *SOUND[1:]], ["no_ground"]),
        (SOUND[:2], ["no_shadow_polygon"]),
        ([(GROUND, PHOTO[:3]), *SOUND[1:]], ["cover_holes"]),
        (SOUND[::-1], ["paint_order"]),
        ([*SOUND, (SHADOW, square(100, 100))], ["polygons_coincide"]),
    ],
)
def test_defects_of_a_file_as_a_whole_are_found(polygons, found):
    assert names(polygons) == found


def boxes(*rows):
    return np.array([kind for kind, _ in rows]), np.array([[*ring.min(0), *ring.max(0)] for _, ring in rows])


def test_objects_that_only_one_of_the_two_files_has_are_found():
    both = boxes((0, square(100, 100)), (1, square(160, 110)))
    assert list(polygon_box_mismatches(SOUND, both)) == []
    more = boxes((0, square(100, 100)), (1, square(160, 110)), (0, square(600, 600)), (1, square(700, 700)))
    assert [defect.name for defect in polygon_box_mismatches(SOUND, more)] == ["rock_box_alone", "shadow_box_alone"]
    other = boxes((0, square(600, 600)), (1, square(100, 100)))
    assert [defect.name for defect in polygon_box_mismatches(SOUND, other)] == [
        "rock_box_alone", "shadow_box_alone", "rock_polygon_alone", "shadow_polygon_alone", "class_mismatch",
    ]  # fmt: skip


def test_polygons_of_the_other_camera_are_found():
    here = [square(100 + 200 * k, 100 + 90 * k) for k in range(4)]
    there = [ring - [150, 0] for ring in here]
    labels = {
        KEY: boxes(*((0, ring) for ring in here)),
        PhotoKey.parse("11_A_off_30_R_2048"): boxes(*((0, ring) for ring in there)),
    }
    assert list(other_camera([(ROCK, ring) for ring in here], KEY, labels)) == []
    (defect,) = other_camera([(ROCK, ring) for ring in there], KEY, labels)
    assert defect.name == "other_camera_polygons"

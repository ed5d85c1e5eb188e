import numpy as np
import pytest

from polarsim.lint.files import box_defects, count_defects

ROCK, SHADOW = 0, 1
SIZE = (1936, 1216)


def box(x, y, width=40, height=30):
    return [x, y, x + width, y + height]


def labels(*rows):
    """Return class and box of each row."""
    return np.array([kind for kind, _ in rows], int), np.array([position for _, position in rows], float).reshape(-1, 4)


SOUND = [(ROCK, box(100, 100)), (SHADOW, box(140, 110)), (ROCK, box(500, 600))]


@pytest.mark.parametrize(
    ("row", "defect"),
    [
        ((ROCK, box(100, 100)), "duplicate"),
        ((ROCK, box(101, 101)), "near_duplicate"),
        ((SHADOW, box(500, 600)), "rock_on_shadow"),
        ((SHADOW, box(900, 900, 63, 4)), "sliver"),  # the flat shadow of 03_B_off_270_L_0128
        ((SHADOW, box(10, 900, 1200, 30)), "giant"),
        ((SHADOW, box(10, 10, 800, 700)), "giant"),  # 24 % of the photo
        ((ROCK, box(1930, 900, 10, 10)), "out_of_photo"),
        ((ROCK, box(-1, 900, 10, 10)), "out_of_photo"),
    ],
)
def test_a_defect_of_a_single_file_is_reported(row, defect):
    (found,) = box_defects(*labels(*SOUND, row), SIZE)
    assert (found.name, found.rows) == (defect, (3,))


def test_sound_boxes_and_no_boxes_have_no_defect():
    at_the_border = [(ROCK, box(0, 0)), (ROCK, box(1896, 1186))]
    assert list(box_defects(*labels(*SOUND, *at_the_border), SIZE)) == []
    assert list(box_defects(*labels(), SIZE)) == []


def test_limits_depend_on_the_size_of_the_photo():
    small = labels((ROCK, box(10, 10, 400, 30)))
    assert list(box_defects(*small, SIZE)) == []
    assert [found.name for found in box_defects(*small, (640, 480))] == ["giant"]


@pytest.mark.parametrize(("rocks", "shadows", "names"), [
    (5, 1, ["few_shadows"]), (5, 2, []), (5, 0, []), (1, 4, ["many_shadows"]), (2, 4, []),
])  # fmt: skip
def test_far_fewer_or_more_shadows_than_rocks_are_found(rocks, shadows, names):
    assert [found.name for found in count_defects(np.array([ROCK] * rocks + [SHADOW] * shadows))] == names

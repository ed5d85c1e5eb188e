import numpy as np
import pytest

from polarsim.acquire.defects import box_defects, missing_exposures, polygon_defects, set_defects
from polarsim.photo import PhotoKey, exposures

KEY = PhotoKey.parse("03_A_off_180_L_0256")
ROCK, SHADOW = 0, 1


def box(x, y, width=40, height=30):
    return [x, y, x + width, y + height]


def labels(*rows):
    """(class, box) of each row."""
    return np.array([kind for kind, _ in rows], int), np.array([place for _, place in rows], float).reshape(-1, 4)


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
def test_a_defect_that_one_file_shows_is_found_and_no_other(row, defect):
    assert [found for found, _ in box_defects(*labels(*SOUND, row))] == [defect]


def test_sound_boxes_and_no_boxes_have_no_defect():
    at_the_border = [(ROCK, box(0, 0)), (ROCK, box(1896, 1186))]
    assert list(box_defects(*labels(*SOUND, *at_the_border))) == []
    assert list(box_defects(*labels())) == []


def photo_set(changed):
    """Five exposures with the sound boxes; those of `changed` (exposure -> rows) have others."""
    rows = dict.fromkeys((128, 256, 512, 1024, 2048), SOUND) | changed
    return {KEY.with_exposure(exposure): labels(*found) for exposure, found in rows.items()}


@pytest.mark.parametrize(
    ("rows", "defects"),
    [
        (SOUND[:2], ["rock_missing"]),
        ([*SOUND, (ROCK, box(900, 900))], ["rock_extra"]),
        ([(ROCK, box(104, 100)), *SOUND[1:]], ["rock_moved"]),  # IoU 36 / 44
        ([*SOUND, (SHADOW, box(900, 900))], ["shadow_extra"]),
        ([SOUND[0], (SHADOW, box(144, 110)), SOUND[2]], ["shadow_moved"]),
        ([SOUND[0], SOUND[2]], ["shadows_off_late"]),
        ([], ["empty_file", "shadows_off_late"]),
    ],
)
def test_one_exposure_that_differs_from_the_others_is_found(rows, defects):
    found = list(set_defects(photo_set({512: rows})))
    assert [defect for _, defect, _ in found] == defects
    assert {key.exposure_ms for key, _, _ in found} == {512}


def test_shadows_that_begin_late_are_no_defect():
    rocks = [SOUND[0], SOUND[2]]
    assert list(set_defects(photo_set({32: rocks, 64: rocks}))) == []


def test_a_file_with_some_of_the_shadows_lacks_the_others():
    two = [*SOUND, (SHADOW, box(540, 610))]
    changed = dict.fromkeys((128, 256, 512, 1024), two)
    ((key, defect, _),) = set_defects(photo_set(changed))
    assert (key.exposure_ms, defect) == (2048, "shadow_missing")


def test_where_two_contents_are_as_frequent_the_one_with_fewer_boxes_counts():
    more = [*SOUND, (ROCK, box(900, 900))]
    files = {KEY.with_exposure(e): labels(*(more if e > 128 else SOUND)) for e in (64, 128, 256, 512)}
    assert [(key.exposure_ms, defect) for key, defect, _ in set_defects(files)] == [
        (256, "rock_extra"),
        (512, "rock_extra"),
    ]


def test_photo_sets_without_any_box_have_no_defect():
    assert list(set_defects({KEY: labels(), KEY.with_exposure(512): labels()})) == []


def test_a_gap_in_a_nearly_complete_photo_set_is_found():
    whole = {KEY.with_exposure(exposure) for exposure in exposures(3, "180")}
    assert missing_exposures(whole) == []
    assert missing_exposures(whole - {KEY}) == [KEY]
    assert missing_exposures({KEY}) == []  # a folder of seeds has one file a photo set by intent


def test_photo_sets_without_sun_are_never_complete():
    key = PhotoKey.parse("03_A_on_no_L_4096")
    assert missing_exposures({key.with_exposure(e) for e in exposures(3, "no") if e != 4096}) == []


@pytest.mark.parametrize(
    ("ring", "defects"),
    [
        ([[0, 0], [50, 50], [50, 0], [0, 40]], ["invalid_ring"]),  # crosses itself
        ([[10, 10], [12, 10], [12, 13], [10, 13]], ["tiny_polygon"]),
        ([[10, 10], [90, 10], [90, 11], [10, 11]], ["thin_polygon"]),
        ([[1900, 10], [1940, 10], [1940, 90]], ["out_of_photo"]),
        ([[10, 10], [90, 10], [90, 80]], []),
        ([[0, 0], [1936, 0], [1936, 1216], [0, 1216]], []),
    ],
)
def test_defects_of_polygons_are_found(ring, defects):
    assert [defect for defect, _ in polygon_defects([(2, np.array(ring, float))])] == defects

import pytest

from polarsim.lint.siblings import missing_exposures, set_defects
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.lint.test_boxes import ROCK, SHADOW, SOUND, box, labels

KEY = PhotoKey.parse("03_A_off_180_L_0256")


def bracket(changed):
    """Return five exposures with sound boxes, except for those in `changed` (exposure -> rows)."""
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
def test_an_exposure_that_differs_is_reported(rows, defects):
    found = list(set_defects(bracket({512: rows})))
    assert [defect.name for _, defect in found] == defects
    assert {key.exposure_ms for key, _ in found} == {512}


def test_short_exposures_without_shadows_have_no_defect():
    rocks = [SOUND[0], SOUND[2]]
    assert list(set_defects(bracket({32: rocks, 64: rocks}))) == []


def test_missing_shadows_are_reported():
    two = [*SOUND, (SHADOW, box(540, 610))]
    changed = dict.fromkeys((128, 256, 512, 1024), two)
    ((key, defect),) = set_defects(bracket(changed))
    assert (key.exposure_ms, defect.name) == (2048, "shadow_missing")


def test_of_two_equally_frequent_contents_the_one_with_fewer_boxes_is_modal():
    more = [*SOUND, (ROCK, box(900, 900))]
    files = {KEY.with_exposure(e): labels(*(more if e > 128 else SOUND)) for e in (64, 128, 256, 512)}
    assert [(key.exposure_ms, defect.name) for key, defect in set_defects(files)] == [
        (256, "rock_extra"),
        (512, "rock_extra"),
    ]


def test_brackets_without_any_box_have_no_defect():
    assert list(set_defects({KEY: labels(), KEY.with_exposure(512): labels()})) == []


def test_a_missing_file_of_a_nearly_complete_bracket_is_reported():
    whole = {KEY.with_exposure(exposure) for exposure in polar().exposures_of(3, "180")}
    assert missing_exposures(whole, polar()) == []
    assert missing_exposures(whole - {KEY}, polar()) == [KEY]
    assert missing_exposures({KEY}, polar()) == []  # folders of seeds have a single file per exposure bracket


def test_brackets_without_sun_are_never_complete():
    key = PhotoKey.parse("03_A_on_no_L_4096")
    assert missing_exposures({key.with_exposure(e) for e in polar().exposures_of(3, "no") if e != 4096}, polar()) == []

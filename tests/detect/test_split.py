import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect.options import DetectOptions
from polarsim.detect.split import draw_split, leaks, read_split, split_photos
from polarsim.errors import DetectError
from polarsim.photo import TERRAINS, PhotoKey, photo_grid

GRID = [key for terrain in TERRAINS for key in photo_grid(terrain)]
BY_PHOTO, BY_TERRAIN = DetectOptions(split="photo"), DetectOptions(split="terrain")


def test_all_photos_split_two_to_one_as_in_the_paper():
    parts = list(draw_split(GRID, BY_PHOTO).values())
    assert len(parts) == 5190
    assert parts.count("test") == 1730  # paper, section 5: 3,460 to train and validate, 1,730 to evaluate


@settings(deadline=None)
@given(st.lists(st.sampled_from(GRID), min_size=6, unique=True), st.integers(0, 5))
def test_every_photo_gets_one_part_and_no_part_is_empty(keys, seed):
    parts = draw_split(keys, DetectOptions(seed=seed))
    assert set(parts) == set(keys)
    assert set(parts.values()) == {"train", "val", "test"}


def test_the_order_of_the_photos_does_not_matter():
    assert draw_split(GRID[::-1], BY_PHOTO) == draw_split(GRID, BY_PHOTO)


def test_another_seed_draws_another_split():
    assert draw_split(GRID, DetectOptions(seed=1)) != draw_split(GRID, BY_PHOTO)


def test_a_split_by_photo_leaks_views_and_one_by_terrain_does_not():
    assert (1, "A", "L") in leaks(draw_split(GRID, BY_PHOTO))
    assert leaks(draw_split(GRID, BY_TERRAIN)) == []


def test_a_third_of_the_terrains_is_left_out():
    parts = draw_split(GRID, BY_TERRAIN)
    tested = {key.terrain for key, part in parts.items() if part == "test"}
    assert len(tested) == 4  # of 13
    assert not tested & {key.terrain for key, part in parts.items() if part != "test"}


def test_given_terrains_are_the_test():
    parts = draw_split(GRID, DetectOptions(split="terrain", test_terrains=(4,)))
    assert {key.terrain for key, part in parts.items() if part == "test"} == {4}


def test_a_leak_is_a_view_on_both_sides():
    left, right = PhotoKey.parse("01_A_off_180_L_0256"), PhotoKey.parse("01_A_off_180_R_0256")
    brighter = left.with_exposure(512)
    assert leaks({left: "train", right: "test"}) == []  # another camera is another view
    assert leaks({left: "val", right: "train", brighter: "test"}) == [(1, "A", "L")]


@pytest.mark.parametrize(
    ("keys", "options", "message"),
    [
        (GRID[:1], BY_PHOTO, "leave"),
        (GRID[:40], BY_TERRAIN, "leave"),
        (GRID[:40], DetectOptions(split="terrain", test_terrains=(7,)), "test terrain 7 has no photos"),
    ],
)
def test_a_split_that_cannot_be_is_refused(keys, options, message):
    with pytest.raises(DetectError, match=message):
        draw_split(keys, options)


def test_a_written_split_reads_back(tmp_path):
    split_photos(keys=GRID[:90], split=tmp_path / "split.csv", options=BY_PHOTO)
    assert read_split(tmp_path / "split.csv") == draw_split(GRID[:90], BY_PHOTO)


def test_an_unknown_part_is_named(tmp_path):
    (tmp_path / "split.csv").write_text("key,part\n01_A_off_180_L_0256,tset\n")
    with pytest.raises(DetectError, match=r"split.csv: part 'tset'"):
        read_split(tmp_path / "split.csv")

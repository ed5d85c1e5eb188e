import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from polarsim.detect.options import SplitOptions
from polarsim.detect.split import draw_split, draw_val, read_split, shared_units, split_photos
from polarsim.errors import DetectError
from polarsim.formats.files import read_json
from polarsim.photo import PhotoKey
from polarsim.site import polar

GRID = [key for terrain in polar().terrains for key in polar().photos_of(terrain)]
OPTIONS = SplitOptions()
STRICT = ("view", "position", "terrain")


def test_all_photos_split_two_to_one_as_in_the_paper():
    parts = list(draw_split(GRID, "photo", OPTIONS).values())
    assert len(parts) == 5190
    assert parts.count("test") == 1730  # paper, section 5: 3,460 to train and validate, 1,730 to evaluate


@settings(deadline=None)
@given(st.lists(st.sampled_from(GRID), min_size=6, unique=True), st.integers(0, 5))
def test_every_photo_gets_one_part_and_no_part_is_empty(keys, seed):
    parts = draw_split(keys, "photo", SplitOptions(seed=seed))
    assert set(parts) == set(keys)
    assert set(parts.values()) == {"train", "val", "test"}


def test_the_seed_matters_and_the_order_of_the_photos_does_not():
    parts = draw_split(GRID, "photo", OPTIONS)
    assert draw_split(GRID[::-1], "photo", OPTIONS) == parts
    assert draw_split(GRID, "photo", SplitOptions(seed=1)) != parts
    assert (1, "A", "L") in shared_units(parts, "view")


@settings(deadline=None)
@given(st.lists(st.sampled_from(GRID), min_size=1, unique=True), st.sampled_from(STRICT), st.integers(0, 5))
def test_a_strict_split_does_not_divide_views(keys, by, seed):
    try:
        parts = draw_split(keys, by, SplitOptions(seed=seed))
    except DetectError:
        assume(False)  # too few photos to split
    assert shared_units(parts, by) == shared_units(parts, "view") == []
    assert set(parts.values()) == {"train", "val", "test"}


@pytest.mark.parametrize(
    ("by", "unit_of"), [("view", lambda k: k.view), ("position", lambda k: k.station), ("terrain", lambda k: k.terrain)]
)
def test_a_third_of_the_units_is_selected(by, unit_of):
    parts = draw_split(GRID, by, OPTIONS)
    tested = {unit_of(key) for key, part in parts.items() if part == "test"}
    others = {unit_of(key) for key, part in parts.items() if part != "test"}
    assert not tested & others
    assert len(tested) == round(len(tested | others) / 3)


def test_the_validation_part_of_a_strict_split_has_entire_units_if_possible():
    parts = draw_split(GRID, "terrain", OPTIONS)
    chosen = {key.terrain for key, part in parts.items() if part == "val"}
    assert len(chosen) == 1  # a tenth of 9
    assert not chosen & {key.terrain for key, part in parts.items() if part == "train"}
    few = draw_split([key for key in GRID if key.terrain < 4], "terrain", OPTIONS)
    assert {key.terrain for key, part in few.items() if part == "val"} == {
        key.terrain for key, part in few.items() if part == "train"
    }  # two terrains are too few for a validation terrain


@pytest.mark.parametrize(("by", "named"), [("view", "1 A L"), ("position", "1 A"), ("terrain", "1")])
def test_a_strict_split_with_shared_units_is_an_error(tmp_path, by, named):
    rows = "01_A_off_180_L_0256,test\n01_A_off_180_L_0512,train\n"
    (tmp_path / "split.csv").write_text(f"key,part\n{rows}")
    with pytest.raises(DetectError, match=f"split.csv.*{by} {named}"):
        read_split(tmp_path / "split.csv", by)
    assert len(read_split(tmp_path / "split.csv", "photo")) == 2
    (tmp_path / "split.csv").write_text(f"key,part\n{rows.replace('test', 'tset')}")
    with pytest.raises(DetectError, match=r"split\.csv"):
        read_split(tmp_path / "split.csv")


def test_a_shared_unit_is_inside_and_outside_the_test_part():
    left, right = PhotoKey.parse("01_A_off_180_L_0256"), PhotoKey.parse("01_A_off_180_R_0256")
    parts = {left: "train", right: "test"}
    assert shared_units(parts, "view") == []  # another camera is another view
    assert shared_units(parts, "position") == [(1, "A")]
    assert shared_units({left: "val", right: "train", left.with_exposure(512): "test"}, "view") == [(1, "A", "L")]


@pytest.mark.parametrize(
    ("keys", "by", "options"),
    [
        (GRID[:1], "photo", OPTIONS),
        (GRID[:40], "terrain", OPTIONS),
        (GRID[:40], "terrain", SplitOptions(test_terrains=(7,))),
    ],
)
def test_an_impossible_split_is_an_error(keys, by, options):
    with pytest.raises(DetectError):
        draw_split(keys, by, options)


def test_a_written_split_reads_back(tmp_path):
    options = SplitOptions(seed=3, test_terrains=(4, 11))
    split_photos(keys=GRID, by="terrain", split=tmp_path / "split.csv", options=options)
    parts = read_split(tmp_path / "split.csv")
    assert parts == draw_split(GRID, "terrain", options)
    assert {key.terrain for key, part in parts.items() if part == "test"} == {4, 11}
    facts = read_json(tmp_path / "split.json")
    assert (facts["by"], facts["seed"], facts["test_terrains"]) == ("terrain", 3, [4, 11])
    assert facts["photos"]["test"] == sum(key.terrain in (4, 11) for key in GRID)
    assert facts["views_on_both_sides"] == 0


@settings(deadline=None)
@given(st.sets(st.text("abc", min_size=1), min_size=2), st.integers(0, 5))
def test_groups_are_divided_into_training_and_validation(groups, seed):
    parts = draw_val(sorted(groups), SplitOptions(seed=seed))
    assert set(parts) == groups
    assert set(parts.values()) == {"train", "val"}

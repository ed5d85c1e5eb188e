import numpy as np
import pytest

from polarsim.geometry.boxes import box_around_points
from polarsim.rocks.annotated import add_annotated_rocks
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import find_ground
from polarsim.rocks.regions import Limits, find_regions
from polarsim.rocks.scans import Extent
from tests.rocks.conftest import Scene

LIMITS = Limits(foot=0.006, height=0.015, confirmed_height=0.010, size=0.035)
SAND = Extent(-1.9, -1.9, 1.9, 1.9)
MOUND, ELSEWHERE = (0.3, -0.2), (-0.5, 0.4)


def ball(x, y, radius=0.05):
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(400, 3))
    return np.array([x, y, radius]) + radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def box(localised, position, points):
    return box_around_points(localised[position].project("L", points)) + np.array([-2, -2, 2, 2])


def evidence(localised, **annotated):
    """Return evidence of boxes by position, repeated in two seed files."""
    return Evidence(localised, {name: [np.array(boxes).reshape(-1, 4)] * 2 for name, boxes in annotated.items()}, 0.3)


def test_a_box_around_a_rock_confirms_it(localised):
    rock = ball(0.2, 0.1)
    found = evidence(localised, A=[box(localised, "A", rock)], C=[box(localised, "C", rock) + 400], B=[[0, 0, 9, 9]])
    assert found.confirming_positions(rock) == ["A"]  # C has other boxes, and B has no pose


def test_parts_have_a_box_in_every_photo_that_was_annotated_in(localised):
    shown, behind = ball(0.2, 0.0), ball(20.0, 0.0)  # the second has negative depth at tripod A
    boxes = evidence(localised, A=[[0, 0, 9, 9]], B=[]).boxes([shown, behind])
    assert list(boxes) == ["A"]
    np.testing.assert_allclose(boxes["A"][0], box_around_points(localised["A"].project("L", shown)))
    assert np.isnan(boxes["A"][1]).all()


def test_boxes_that_no_rock_fills_are_unexplained(localised):
    rock, other = ball(0.2, 0.0), ball(-0.4, 0.3)
    boxes = [box(localised, "A", rock), box(localised, "A", other)]
    left = evidence(localised, A=boxes).unexplained([rock])
    np.testing.assert_allclose(left["A"], boxes[1:])
    np.testing.assert_allclose(evidence(localised, A=boxes).unexplained([])["A"], boxes)


def test_boxes_that_belong_to_another_position_are_no_evidence(localised, caplog):
    rocks = [ball(x, y) for x, y in [(0.2, 0.1), (-0.5, 0.4), (0.6, -0.3), (-0.2, -0.7), (0.8, 0.5)]]
    own = {name: [box(localised, name, rock) for rock in rocks] for name in "AC"}
    assert sorted(evidence(localised, **own).without_mislabelled(rocks).agreed) == ["A", "C"]
    assert not caplog.records
    kept = evidence(localised, A=own["A"], C=own["A"]).without_mislabelled(rocks)
    assert list(kept.agreed) == ["A"]
    assert kept.confirming_positions(rocks[0]) == ["A"]
    assert "position C" in caplog.text


def mound(x, y):
    return 0.014 * np.exp(-((x - MOUND[0]) ** 2 + (y - MOUND[1]) ** 2) / 0.025**2)


@pytest.fixture(scope="module")
def low_rock():
    scans = Scene(mound).scanned(np.random.default_rng(3))
    return find_ground(scans.select(SAND.contains(scans.points)), SAND, 0.008)


def around_point(localised, position, spot):
    x, y = spot
    corners = [(x + dx, y + dy, z) for dx in (-0.035, 0.035) for dy in (-0.035, 0.035) for z in (0.0, 0.01)]
    return box(localised, position, np.array(corners))


def looked_into(localised, sand, **points):
    boxes = {name: [around_point(localised, name, position)] for name, position in points.items()}
    shown = evidence(localised, **boxes)
    return add_annotated_rocks(sand, find_regions(sand, LIMITS, shown), LIMITS, shown)


def test_a_low_rock_is_detected_if_two_positions_show_it(localised, low_rock):
    sand, regions = looked_into(localised, low_rock, A=MOUND, C=MOUND)
    assert [region.confirmed for region in regions] == [("A", "C")]
    np.testing.assert_allclose(regions[0].centre, MOUND, atol=0.015)
    assert regions[0].height == pytest.approx(0.012, abs=0.004)
    assert not sand.is_ground.ravel()[regions[0].seen].any()


def test_two_boxes_of_a_low_rock_add_it_once(localised, low_rock):
    shown = evidence(localised, A=[around_point(localised, "A", MOUND)], C=[around_point(localised, "C", MOUND)])
    twice = Evidence(localised, {"A": shown.annotated["A"], "C": shown.annotated["C"]}, 0.3)
    twice.agreed["C"] = np.concatenate([twice.agreed["C"], twice.agreed["C"] + 1])
    _, regions = add_annotated_rocks(low_rock, [], LIMITS, twice)
    assert len(regions) == 1


def test_a_single_position_or_boxes_on_level_sand_give_no_rock(localised, low_rock):
    for points in ({"A": MOUND}, {"A": ELSEWHERE, "C": ELSEWHERE}, {"A": MOUND, "C": ELSEWHERE}):
        sand, regions = looked_into(localised, low_rock, **points)
        assert regions == []
        np.testing.assert_array_equal(sand.is_ground, low_rock.is_ground)


def test_seed_boxes_of_another_terrain_are_a_warning(localised, caplog):
    rocks = [ball(x, y) for x, y in [(0.2, 0.1), (-0.5, 0.4), (0.6, -0.3), (-0.2, -0.7), (0.8, 0.5)]]
    others = [ball(x, y) for x, y in [(0.7, 0.1), (-0.9, 0.3), (0.1, -0.4), (-0.7, -0.6), (0.4, 0.7)]]
    boxes = [box(localised, "A", rock) for rock in rocks]
    evidence(localised, A=boxes).warn_of_other_terrain("terrain 01", rocks[:4] + others)
    evidence(localised, A=boxes[:4]).warn_of_other_terrain("terrain 01", others)  # too few boxes
    assert not caplog.records
    evidence(localised, A=boxes).warn_of_other_terrain("terrain 01", rocks[:1] + others)
    assert "terrain 01: 4 of 5 seed boxes" in caplog.text

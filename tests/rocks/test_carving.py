"""Rocks that are connected to another rock: effect of boxes of a single position."""

import numpy as np
import pytest

from polarsim.geometry.boxes import box_around_points
from polarsim.rocks.annotated import add_carved_rocks
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import find_ground
from polarsim.rocks.regions import Limits, find_regions, measure_mask, scanned_points
from polarsim.rocks.scans import Extent
from tests.rocks.conftest import Scene, angular_rock

LIMITS = Limits(foot=0.006, height=0.015, confirmed_height=0.010, size=0.035)
SAND = Extent(-1.9, -1.9, 1.9, 1.9)
LARGE, SMALL = (0.2, -0.1, 0.03), (0.33, -0.1, 0.0)
LEANING = (0.36, -0.1, 0.01)  # less deep in the large rock, so that a crease is visible


def two_rocks(small):
    """Return the visible parts of a rock of 28 cm and of a rock of 12 cm that leans on it towards tripod A."""
    rng = np.random.default_rng(8)
    return [angular_rock(rng, LARGE, 0.28), angular_rock(rng, small, 0.12)]


def scanned(rocks):
    scans = Scene(rocks=rocks).scanned(np.random.default_rng(3))
    return find_ground(scans.select(SAND.contains(scans.points)), SAND, 0.006)


@pytest.fixture(scope="module")
def rocks():
    return two_rocks(SMALL)


@pytest.fixture(scope="module")
def sand(rocks):
    return scanned(rocks)


def box(localised, position, rock):
    points = rock.points[rock.points[:, 2] > 0]
    feet = rock.points * [1, 1, 0]  # annotations extend to the sand
    return box_around_points(
        localised[position].project("L", np.concatenate([points, feet[rock.vertices] * 0.9 + 0.1 * feet.mean(0)]))
    )


def found(sand, localised, **annotated):
    evidence = Evidence(localised, {name: [np.array(boxes).reshape(-1, 4)] for name, boxes in annotated.items()}, 0.3)
    return add_carved_rocks(sand, find_regions(sand, LIMITS, evidence), LIMITS, evidence)[1]


def sizes(regions):
    return sorted(round(region.size, 2) for region in regions)


def test_a_leaning_rock_is_detected_without_boxes():
    large, small = sorted(
        find_regions(scanned(two_rocks(LEANING)), LIMITS, Evidence({}, {}, 0.3)), key=lambda r: -r.size
    )
    np.testing.assert_allclose(small.centre, LEANING[:2], atol=0.03)
    np.testing.assert_allclose(large.centre, LARGE[:2], atol=0.03)


def test_a_deeply_leaning_rock_without_a_box_is_part_of_the_other_rock(sand, localised, rocks):
    assert len(found(sand, localised)) == 1
    assert len(found(sand, localised, A=[box(localised, "A", rocks[0])], C=[box(localised, "C", rocks[0])])) == 1


def test_a_box_of_one_position_cuts_out_the_rock(sand, localised, rocks):
    boxes = {"A": [box(localised, "A", rock) for rock in rocks], "C": [box(localised, "C", rocks[0])]}
    regions = found(sand, localised, **boxes)
    assert len(regions) == 2
    large, small = sorted(regions, key=lambda region: -region.size)
    np.testing.assert_allclose(small.centre, SMALL[:2], atol=0.03)
    np.testing.assert_allclose(large.centre, LARGE[:2], atol=0.03)
    assert (small.confirmed, large.confirmed) == (("A",), ("A", "C"))
    assert not set(small.seen) & set(large.seen)


def test_a_cut_that_worsens_the_fit_of_the_other_rock_is_rejected(sand, localised, rocks):
    whole = np.concatenate([rock.points[rock.points[:, 2] > 0] for rock in rocks])
    joint = box_around_points(localised["C"].project("L", whole))
    alone = found(sand, localised, C=[joint])
    assert sizes(found(sand, localised, A=[box(localised, "A", rocks[1])], C=[joint])) == sizes(alone)


def test_touching_regions_are_joined_if_boxes_show_one_rock(sand, localised):
    [rock] = find_regions(sand, LIMITS, Evidence({}, {}, 0.3))
    points = sand.grid.centres().reshape(-1, 2)[rock.seen]
    halves = []
    for half in (points[:, 0] < rock.centre[0], points[:, 0] >= rock.centre[0]):
        mask = np.zeros(sand.surface.shape, bool)
        mask.ravel()[rock.seen[half]] = True
        halves.append(measure_mask(sand, mask))
    annotated = box_around_points(localised["A"].project("L", scanned_points(sand, rock.seen)))
    [joined] = add_carved_rocks(sand, halves, LIMITS, Evidence(localised, {"A": [annotated[None]]}, 0.3))[1]
    np.testing.assert_array_equal(joined.seen, np.sort(rock.seen))
    assert joined.confirmed == ("A",)
    assert len(add_carved_rocks(sand, halves, LIMITS, Evidence({}, {}, 0.3))[1]) == 2


def test_a_box_on_bare_sand_adds_no_rock(sand, localised):
    x, y = -0.8, 0.7
    corners = np.array([(x + dx, y + dy, z) for dx in (-0.06, 0.06) for dy in (-0.06, 0.06) for z in (0.0, 0.04)])
    assert len(found(sand, localised, A=[box_around_points(localised["A"].project("L", corners))])) == 1

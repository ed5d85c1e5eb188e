import numpy as np
import pytest

from polarsim.rocks.crops import crop_rocks
from polarsim.rocks.ground import find_ground, sand_extent
from polarsim.rocks.overrides import Cuboid, Overrides
from polarsim.rocks.regions import Limits, find_regions
from polarsim.rocks.scans import Extent, ScanPoints

CELL = 0.008
SLOPE = np.radians(40)
LIMITS = Limits(foot=0.006, height=0.015, confirmed_height=0.010, size=0.035)
SAND = Extent(-1.9, -1.9, 1.9, 1.9)
PLACES = [(0.9, 0.6), (-0.2, -0.9), (1.1, -0.5)]


def nobody(points):
    return []


def regions_of(scans):
    sand = find_ground(scans.select(SAND.contains(scans.points)), SAND, CELL, SLOPE)
    return sand, find_regions(sand, LIMITS, nobody)


def hills(places):
    x, y = places[..., 0], places[..., 1]
    r = np.hypot(x + 0.4, y - 0.2)
    return 0.05 * np.exp(-(((r - 0.8) / 0.25) ** 2)) - 0.06 * np.exp(-((r / 0.5) ** 2)) + 0.03 * np.sin(1.5 * y)


@pytest.fixture(scope="module")
def found(three_rock_scans):
    return regions_of(three_rock_scans)


def test_a_crater_without_rocks_gives_no_rock(bare_scans):
    sand, regions = regions_of(bare_scans)
    assert regions == []
    assert sand.is_ground.mean() > 0.8


def test_every_rock_is_one_region_around_its_place(found):
    sand, regions = found
    cells = sand.grid.cell_of(np.array(PLACES))
    assert len(regions) == len(PLACES)
    assert sorted(n for n, region in enumerate(regions) for cell in cells if cell in region.footprint) == [0, 1, 2]


def test_sizes_are_right_to_two_cells(found):
    sizes = sorted(region.size for region in found[1])
    np.testing.assert_allclose(sizes, [0.08, 0.12, 0.25], atol=2 * CELL)


def test_the_ground_is_right_also_under_the_rocks(found):
    sand, _ = found
    error = np.abs(sand.ground - hills(sand.grid.places()))
    assert np.median(error) < 0.0005
    near_rocks = (np.abs(sand.grid.places()[:, :, None] - np.array(PLACES)).max(axis=-1) < 0.08).any(axis=-1)
    assert error[near_rocks].max() < 0.012


def test_the_order_of_points_does_not_matter(three_rock_scans, found, rng):
    shuffled = three_rock_scans.select(rng.permutation(len(three_rock_scans)))
    _, regions = regions_of(shuffled)
    for one, other in zip(regions, found[1], strict=True):
        np.testing.assert_array_equal(one.seen, other.seen)
        assert one.height == pytest.approx(other.height, abs=1e-9)


def test_ids_do_not_change_with_other_noise(three_rocks, found):
    _, regions = regions_of(three_rocks.scanned(np.random.default_rng(77), noise=0.003))
    for one, other in zip(regions, found[1], strict=True):
        assert np.linalg.norm(one.centre - other.centre) < 0.01


def test_a_cuboid_of_the_override_file_wins_and_drops_are_left_out(found):
    sand, regions = found
    kept = regions[0]
    around = Cuboid(np.array([*(kept.centre - 0.2), -1.0]), np.array([*(kept.centre + 0.2), 1.0]))
    _, rocks = crop_rocks(sand, regions, Overrides({7: around}, drop=(2,)), LIMITS.foot)
    assert {rock: one.source for rock, one in rocks.items()} == {3: "scan", 7: "override"}
    np.testing.assert_allclose(rocks[7].region.centre, kept.centre, atol=0.02)


def test_a_find_whose_id_is_taken_gets_the_next_free_one(found):
    sand, regions = found
    around = Cuboid(np.array([*(regions[0].centre - 0.2), -1.0]), np.array([*(regions[0].centre + 0.2), 1.0]))
    _, rocks = crop_rocks(sand, regions, Overrides({3: around}), LIMITS.foot)
    assert sorted(rocks) == [2, 3, 4]
    np.testing.assert_array_equal(rocks[4].region.seen, regions[2].seen)


def test_cloth_that_hangs_into_the_box_becomes_no_ground(bare_scans, rng):
    corner = rng.uniform([-1.9, -1.9], [-1.7, -1.7], (40_000, 2))
    cloth = np.column_stack([corner, 0.15 + 0.03 * rng.normal(size=len(corner))])
    away = bare_scans.points[:, :2].max(axis=1) > -1.7
    points = np.concatenate([bare_scans.points[away], cloth])
    scans = ScanPoints(points, np.tile([0.0, 0, 1], (len(points), 1)), np.ones(len(points)))
    sand, regions = regions_of(scans)
    sand, _ = crop_rocks(sand, regions, Overrides(), LIMITS.foot)
    error = sand.ground - hills(sand.grid.places())
    assert np.abs(error[:30, :30]).max() < 0.08  # 24 cm of the corner, filled from beside it


def test_a_low_find_is_kept_where_labels_confirm_it(three_rock_scans):
    sand = find_ground(three_rock_scans.select(SAND.contains(three_rock_scans.points)), SAND, CELL, SLOPE)
    high = Limits(foot=0.006, height=0.2, confirmed_height=0.010, size=0.035)
    assert find_regions(sand, high, nobody) == []
    confirmed = find_regions(sand, high, lambda points: ["A"] if points[:, 0].mean() > 0.5 else [])
    assert [region.confirmed for region in confirmed] == [("A",), ("A",)]


def test_walls_bound_the_sand(rng):
    floor = np.column_stack([rng.uniform(-2.2, 2.2, (200_000, 2)), np.zeros(200_000)])
    wall = np.column_stack([np.full(40_000, -1.93), rng.uniform(-2, 2, 40_000), rng.uniform(0, 0.3, 40_000)])
    points = np.concatenate([floor, wall])
    extent = sand_extent(ScanPoints(points, np.zeros_like(points), np.ones(len(points))))
    assert extent.x0 == pytest.approx(-1.93 + 0.03, abs=0.005)
    assert (extent.y0, extent.x1, extent.y1) == (-1.97, 1.97, 1.97)  # the survey's 2.0 m less the margin

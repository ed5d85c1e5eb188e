import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import ReconstructionError
from polarsim.geometry.poses import Pose
from polarsim.rocks.crops import crop_rocks
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import find_ground, sand_extent
from polarsim.rocks.overrides import Cuboid, Overrides
from polarsim.rocks.regions import Limits, RockRegion, _has_rock_shape, find_regions, number_regions
from polarsim.rocks.scans import Extent, ScanPoints
from polarsim.site import polar
from tests.rocks.conftest import SIZES, hilly
from tests.support.other_site import other_site
from tests.support.polar_survey import HALF, SANDBOX

CELL = 0.008
LIMITS = Limits(foot=0.006, height=0.015, confirmed_height=0.010, size=0.035)
SAND = Extent(-1.9, -1.9, 1.9, 1.9)
PLACES = list(SIZES)


def regions_of(scans):
    sand = find_ground(scans.select(SAND.contains(scans.points)), SAND, CELL)
    return sand, find_regions(sand, LIMITS, Evidence({}, {}, 0.3))


def hills(points):
    return hilly(points[..., 0], points[..., 1])


@pytest.fixture(scope="module")
def found(three_rock_scans):
    return regions_of(three_rock_scans)


def test_a_crater_without_rocks_gives_no_rock(bare_scans):
    sand, regions = regions_of(bare_scans)
    assert regions == []
    assert sand.is_ground.mean() > 0.8


def test_every_rock_is_one_region_around_its_position(found):
    sand, regions = found
    cells = sand.grid.cell_of(np.array(PLACES))
    assert len(regions) == len(PLACES)
    assert sorted(n for n, region in enumerate(regions) for cell in cells if cell in region.footprint) == [0, 1, 2]


def size_above(rock, height):
    """Return the longest horizontal side of the part of a rock above a height, from points on its faces."""
    weights = np.random.default_rng(0).dirichlet(np.full(3, 0.5), (len(rock.simplices), 400))
    points = np.einsum("fks,fsd->fkd", weights, rock.points[rock.simplices]).reshape(-1, 3)
    return np.ptp(points[points[:, 2] > hills(points[:, :2]) + height, :2], axis=0).max()


def test_sizes_above_the_foot_are_right_to_two_cells(found, three_rocks):
    sizes = sorted(region.size for region in found[1])
    true = sorted(size_above(rock, LIMITS.foot) for rock in three_rocks.rocks)
    np.testing.assert_allclose(sizes, true, atol=2 * CELL)


def test_the_ground_is_accurate_under_rocks(found):
    sand, _ = found
    error = np.abs(sand.ground - hills(sand.grid.centres()))
    assert np.median(error) < 0.0005
    near_rocks = (np.abs(sand.grid.centres()[:, :, None] - np.array(PLACES)).max(axis=-1) < 0.08).any(axis=-1)
    assert error[near_rocks].max() < 0.012


def test_the_order_of_points_does_not_matter(three_rock_scans, found, rng):
    shuffled = three_rock_scans.select(rng.permutation(len(three_rock_scans)))
    _, regions = regions_of(shuffled)
    for one, other in zip(regions, found[1], strict=True):
        np.testing.assert_array_equal(one.seen, other.seen)
        assert one.height == pytest.approx(other.height, abs=1e-9)


def test_a_motion_of_the_scene_moves_the_rocks(three_rock_scans, found):
    quarter = Pose.from_rotvec(np.array([0, 0, np.pi / 2]), np.array([10 * CELL, -5 * CELL, 0.1]))
    inside = three_rock_scans.select((np.abs(three_rock_scans.points[:, :2]) < 1.7).all(axis=1))
    _, before = regions_of(inside)
    _, after = regions_of(inside.moved(quarter))
    moved = [quarter.apply(np.append(region.centre, 0)[None])[0, :2] for region in before]
    pairs = [min(after, key=lambda other: np.linalg.norm(other.centre - position)) for position in moved]
    assert len(after) == len(before) == len({id(other) for other in pairs})
    for region, position, other in zip(before, moved, pairs, strict=True):
        np.testing.assert_allclose(other.centre, position, atol=CELL)
        assert other.height == pytest.approx(region.height, abs=0.002)
        assert other.volume == pytest.approx(region.volume, rel=0.1)


def region(x, y, size=0.1):
    cells = np.zeros(0, int)
    return RockRegion(cells, cells, np.array([x, y]), size, 0.05, 1e-4)


def test_an_id_is_the_number_of_a_square_of_the_sandbox():
    low, next_one, above, high = (
        region(*position) for position in [(-1.9, -1.9), (-1.6, -1.9), (-1.9, -1.6), (1.9, 1.9)]
    )
    assert {rock: id(one) for rock, one in number_regions([above, high, next_one, low], HALF).items()} == {
        1: id(low), 2: id(next_one), 17: id(above), 256: id(high),
    }  # fmt: skip


def test_ids_in_a_square_are_ordered_by_size_and_rocks_outside_get_ids_of_the_border():
    many = [region(0.1 + 0.01 * k, 0.1, 0.2 - 0.01 * k) for k in range(5)]
    assert list(number_regions(many, HALF)) == [137, 393, 649, 769, 770]
    assert [id(one) for one in number_regions(many, HALF).values()] == [id(one) for one in many]
    assert list(number_regions([region(-2.1, 2.1)], HALF)) == [241]


@given(gone=st.integers(0, 39), seed=st.integers(0, 50))
def test_a_removed_rock_changes_only_ids_of_its_square(gone, seed):
    rng = np.random.default_rng(seed)
    rocks = [region(*rng.uniform(-1.9, 1.9, 2), size) for size in rng.uniform(0.05, 0.3, 40)]
    before = {id(one): rock for rock, one in number_regions(rocks, HALF).items()}
    after = {id(one): rock for rock, one in number_regions(rocks[:gone] + rocks[gone + 1 :], HALF).items()}
    square = np.floor(rocks[gone].centre / 0.25)
    for one in rocks:
        if one is not rocks[gone] and (np.floor(one.centre / 0.25) != square).any():
            assert after[id(one)] == before[id(one)]


def around(region):
    return Cuboid(np.array([*(region.centre - 0.2), -1.0]), np.array([*(region.centre + 0.2), 1.0]))


def test_overrides_decide_ids_and_crops(found, caplog):
    """By id: the region that a rock has after the overrides, or `override` for a cuboid."""
    sand, regions = found
    (_, one), (b, two), (c, three) = number_regions(regions, HALF).items()
    nowhere = np.array([-1.2, 1.2])
    cases = [
        (Overrides({7: around(one)}, drop=(b,)), {7: "override", c: three}),
        (Overrides({c: around(one)}), {b: two, c: "override", c + 1: three}),  # the used id moves to the next free one
        (
            Overrides(positions={2: one.centre + 0.01, 9: two.centre, c: nowhere}),
            {2: one, 9: two, c + 1: three},  # the third id is reserved for its rock
        ),
        (Overrides(positions={8: one.centre}, drop=(8,)), {b: two, c: three}),
    ]
    for overrides, expected in cases:
        _, rocks = crop_rocks(sand, regions, overrides, LIMITS.foot, HALF)
        got = {rock: crop.source if crop.source == "override" else crop.region for rock, crop in rocks.items()}
        assert list(got) == list(expected)
        for rock, region in expected.items():
            if region == "override":
                np.testing.assert_allclose(rocks[rock].region.centre, one.centre, atol=0.02)
            else:
                np.testing.assert_array_equal(got[rock].seen, region.seen)
    assert f"rock {c}: no detected rock at -1.200, 1.200" in caplog.text


@pytest.mark.parametrize("gone", [(0,), (0, 2)])
def test_ids_of_positions_do_not_depend_on_other_regions(found, gone):
    sand, regions = found
    points = {rock: region.centre for rock, region in enumerate(regions, 1)}
    left = {rock: region for rock, region in enumerate(regions, 1) if rock - 1 not in gone}
    _, rocks = crop_rocks(sand, list(left.values()), Overrides(positions=points), LIMITS.foot, HALF)
    assert {rock: id(crop.region) for rock, crop in rocks.items()} == {rock: id(own) for rock, own in left.items()}


def test_a_rock_that_is_only_annotated_changes_no_other_id(found):
    sand, regions = found
    lowest = min(region.height for region in regions)
    picky = Limits(foot=0.006, height=lowest + 0.001, confirmed_height=0.010, size=0.035)

    class Annotated(Evidence):
        def confirming_positions(self, points):
            return ["A"]

    before, after = (
        number_regions(find_regions(sand, picky, evidence({}, {}, 0.3)), HALF) for evidence in (Evidence, Annotated)
    )
    assert len(before) == 2
    assert len(after) == 3
    for rock, one in before.items():
        np.testing.assert_array_equal(one.seen, after[rock].seen)


def test_cloth_in_the_box_is_not_ground(bare_scans, rng):
    corner = rng.uniform([-1.9, -1.9], [-1.7, -1.7], (40_000, 2))
    cloth = np.column_stack([corner, 0.15 + 0.03 * rng.normal(size=len(corner))])
    away = bare_scans.points[:, :2].max(axis=1) > -1.7
    points = np.concatenate([bare_scans.points[away], cloth])
    scans = ScanPoints(points, np.tile([0.0, 0, 1], (len(points), 1)), np.ones(len(points)))
    sand, regions = regions_of(scans)
    sand, _ = crop_rocks(sand, regions, Overrides(), LIMITS.foot, HALF)
    error = sand.ground - hills(sand.grid.centres())
    assert np.abs(error[:30, :30]).max() < 0.08  # 24 cm of the corner, filled from neighbours


def test_a_low_region_is_kept_if_labels_confirm_it(found):
    sand, _ = found
    high = Limits(foot=0.006, height=0.2, confirmed_height=0.010, size=0.035)
    assert find_regions(sand, high, Evidence({}, {}, 0.3)) == []

    class Right(Evidence):
        def confirming_positions(self, points):
            return ["A"] if points[:, 0].mean() > 0.5 else []

    confirmed = find_regions(sand, high, Right({}, {}, 0.3))
    assert [region.confirmed for region in confirmed] == [("A",), ("A",)]


def with_patch(scans, size, height, rng):
    """Return scans with a level patch of `size` (x, y) metres above the sand at (0.6, 1.0)."""
    low, high = np.array([0.6, 1.0]) - np.array(size) / 2, np.array([0.6, 1.0]) + np.array(size) / 2
    away = ((scans.points[:, :2] < low) | (scans.points[:, :2] > high)).any(axis=1)
    spots = rng.uniform(low, high, (round(2e5 * np.prod(size)), 2))
    patch = np.column_stack([spots, hills(spots) + height + 0.001 * rng.normal(size=len(spots))])
    points = np.concatenate([scans.points[away], patch])
    return ScanPoints(points, np.tile([0.0, 0, 1], (len(points), 1)), np.ones(len(points)))


def test_swells_and_upright_strips_are_not_rocks_but_a_stone_is(bare_scans, rng):
    for size, height, expected in (((0.30, 0.30), 0.022, 0), ((0.06, 0.05), 0.15, 0), ((0.10, 0.10), 0.05, 1)):
        sand, regions = regions_of(with_patch(bare_scans, size, height, rng))
        assert len(regions) == expected, (size, height)
        if height > size[0]:  # an upright strip makes no spike in the ground
            sand, _ = crop_rocks(sand, regions, Overrides(), LIMITS.foot, HALF)
            assert np.abs(sand.ground - hills(sand.grid.centres())).max() < 0.02


def test_visible_sand_under_an_overhang_does_not_cut_a_rock(rng):
    # A vault of 24 cm, 12 cm high; one scan shows its top, another scan the sand below its centre.
    sand = np.column_stack([rng.uniform(-1.9, 1.9, (1_000_000, 2)), np.zeros(1_000_000)])
    away = np.hypot(*(sand[:, :2] - [0.4, 0.2]).T)
    vault = np.column_stack([sand[away < 0.12, :2], np.sqrt(0.12**2 - away[away < 0.12] ** 2)])
    below = sand[(away < 0.12) & (np.abs(sand[:, 0] - 0.4) < 0.03)]
    points = np.concatenate([sand[away >= 0.12], vault, below])
    points[:, 2] += 0.001 * rng.normal(size=len(points))
    _, regions = regions_of(ScanPoints(points, np.tile([0.0, 0, 1], (len(points), 1)), np.ones(len(points))))
    assert [round(region.size, 1) for region in regions] == [0.2]


def test_walls_bound_the_sand(rng):
    floor = np.column_stack([rng.uniform(-2.2, 2.2, (200_000, 2)), np.zeros(200_000)])
    wall = np.column_stack([np.full(40_000, -1.93), rng.uniform(-2, 2, 40_000), rng.uniform(0, 0.3, 40_000)])
    points = np.concatenate([floor, wall])
    extent = sand_extent(ScanPoints(points, np.zeros_like(points), np.ones(len(points))), SANDBOX)
    assert extent.x0 == pytest.approx(-1.93 + 0.03, abs=0.005)
    assert (extent.y0, extent.x1, extent.y1) == (-1.97, 1.97, 1.97)  # the surveyed 2.0 m minus the margin


def test_a_small_box_is_bounded_by_its_width(rng):
    points = np.column_stack([rng.uniform(-0.7, 0.7, (50_000, 2)), np.zeros(50_000)])
    points[(np.abs(points[:, :2]) > 0.53).any(axis=1), 2] = -0.4  # the floor around it
    extent = sand_extent(ScanPoints(points, np.zeros_like(points), np.ones(len(points))), polar().sandbox_of(13))
    assert (extent.x0, extent.y0, extent.x1, extent.y1) == (-0.47, -0.47, 0.47, 0.47)


@pytest.mark.parametrize(
    ("size", "height", "rock"),
    [
        (0.155, 0.156, True),  # a block of 16 cm on the sand with a hidden back
        (0.10, 0.07, True),
        (0.10, 0.15, False),  # the edge of a partly hidden object, cloth, a lamp's foot
        (0.30, 0.03, False),  # a swell of the sand
        (0.05, 0.012, False),  # too low
    ],
)
def test_rocks_are_neither_flat_nor_upright(size, height, rock):
    region = RockRegion(np.zeros(1, int), np.zeros(1, int), np.zeros(2), size, height, 0.0)
    assert _has_rock_shape(region, LIMITS) == rock


YARD = other_site().sandbox  # 3 m x 6 m, walls of 0.2 m on three sides


def test_ids_of_a_larger_yard_are_unique_and_below_those_of_rocks_without_mesh():
    half = np.array(YARD.half_width_m)
    places = np.stack(np.meshgrid(np.arange(-1.4, 1.5, 0.28), np.arange(-2.9, 3.0, 0.28)), axis=-1).reshape(-1, 2)
    ids = list(number_regions([region(*place) for place in places], half))
    assert len(ids) == len(places)
    assert max(ids) < 300  # one rock in each square of 0.27 m
    crowded = [region(*place, size) for place in places for size in (0.1, 0.2, 0.3)]
    assert max(number_regions(crowded, half)) <= 3 * 256
    far = {int(rock): one.centre for rock, one in number_regions([region(*place) for place in places], half).items()}
    assert np.linalg.norm(far[1] - [-1.4, -2.9]) < 0.3  # numbers grow along x, then along y
    with pytest.raises(ReconstructionError, match="min_size_mm"):
        number_regions([region(0, 0)] * 901, half)


def test_an_open_side_of_a_rectangle_is_bounded_by_the_site(rng):
    floor = np.column_stack([rng.uniform(-2, 2, 200_000), rng.uniform(-3.4, 3.4, 200_000), np.zeros(200_000)])
    wall = np.column_stack([rng.uniform(-1.5, 1.5, 40_000), np.full(40_000, 2.9), rng.uniform(0, 0.2, 40_000)])
    heap = wall * [1, -1, 1]  # a heap of stones where the site has no wall
    points = np.concatenate([floor, wall, heap])
    extent = sand_extent(ScanPoints(points, np.zeros_like(points), np.ones(len(points))), YARD)
    assert extent.y1 == pytest.approx(2.9 - 0.03, abs=0.005)
    assert (extent.x0, extent.y0, extent.x1) == (-1.47, -2.97, 1.47)

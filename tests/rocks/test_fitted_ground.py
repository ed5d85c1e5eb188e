"""Ground under published rocks: limited slope, exact for feet on a plane, independent of the order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.formats import obj
from polarsim.geometry.outlines import rim
from polarsim.rocks.adopt import cleaned
from polarsim.rocks.fitted_ground import FOOT_SD, MAX_SLOPE_DEG, QUADRIC_FROM, fit_ground
from polarsim.rocks.folder import height_mesh
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.scans import Extent

GRID = FloorGrid(Extent(-1.0, -1.0, 1.0, 1.0), 0.04)
SIDE = st.floats(-1.2, 1.2)


def foot(x, y, z, radius=0.05, points=8):
    angle = 2 * np.pi * np.arange(points) / points
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle), np.full(points, z)], axis=1)


def steepest_deg(grid, heights):
    """Return the slopes of all triangles of the mesh."""
    mesh = height_mesh(grid, heights)
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.degrees(np.arctan2(np.linalg.norm(normal[:, :2], axis=1), np.abs(normal[:, 2]))).max()


@settings(max_examples=20)
@given(
    feet=st.lists(
        st.tuples(SIDE, SIDE, st.floats(-2, 2), st.floats(0, 0.2), st.integers(1, 24)), max_size=QUADRIC_FROM + 2
    )
)
def test_no_ground_is_steeper_than_the_angle_of_repose(feet):
    heights = fit_ground([foot(*one) for one in feet], GRID)
    assert np.isfinite(heights).all()
    assert steepest_deg(GRID, heights) <= MAX_SLOPE_DEG


@settings(max_examples=12)
@given(
    feet=st.lists(st.tuples(SIDE, SIDE, st.integers(3, 9)), min_size=3, max_size=QUADRIC_FROM + 2, unique=True),
    plane=st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-1, 1)),
)
def test_feet_on_a_plane_give_this_plane(feet, plane):
    a, b, c = plane
    rims = [foot(x, y, 0, points=points) for x, y, points in feet]
    for own in rims:
        own[:, 2] = a * own[:, 0] + b * own[:, 1] + c
    x, y = np.moveaxis(GRID.centres(), -1, 0)
    np.testing.assert_allclose(fit_ground(rims, GRID), a * x + b * y + c, atol=1e-6)


@settings(max_examples=12)
@given(data=st.data(), feet=st.lists(st.tuples(SIDE, SIDE, st.floats(-0.2, 0.2)), min_size=1, max_size=8, unique=True))
def test_order_and_copies_of_rocks_and_points_do_not_matter(data, feet):
    rims = [foot(*one) for one in feet]
    copies = data.draw(st.permutations([*rims, *data.draw(st.lists(st.sampled_from(rims), max_size=3))]))
    shuffled = [np.asfortranarray(np.concatenate([own[::-1], own[:2]])) for own in copies]
    np.testing.assert_array_equal(fit_ground(shuffled, GRID), fit_ground(rims, GRID))


def test_a_rock_on_top_of_another_rock_does_not_lift_the_slope():
    slope = lambda points: 0.03 * points[..., 0] - 0.02 * points[..., 1]  # noqa: E731
    places = np.array([[x, y] for x in (-0.9, -0.3, 0.3, 0.9) for y in (-0.8, 0.0, 0.8)])
    rims = [foot(x, y, 0) for x, y in places]
    for number, own in enumerate(rims):
        own[:, 2] = slope(own) + 0.15 * (number == 0)
    ground = fit_ground(rims, GRID)
    far = np.linalg.norm(GRID.centres() - places[0], axis=-1) > 0.9
    assert np.abs(ground - slope(GRID.centres()))[far].max() < FOOT_SD / 2
    gaps = np.array([np.abs(own[:, 2] - GRID.sample(ground, own)).max() for own in rims])
    assert gaps[0] > FOOT_SD  # feet are soft constraints, without a cliff at the outlier
    assert gaps[1:].max() < FOOT_SD / 2


def test_a_slope_within_the_bound_is_kept():
    """The bound is only active near two contradicting feet: a distant gentle hill keeps nearly all of its height."""
    wide = FloorGrid(Extent(-2.1, -2.1, 2.1, 2.1), 0.02)
    level = [foot(x, y, 0.0) for x in (-1.5, -0.5, 0.5, 1.5) for y in (-1.5, 0.0, 1.5)]
    hill, cliff = foot(1.0, 0.75, 0.05), [foot(-1.0, 0.75, 0.25), foot(-1.0, 0.62, -0.25)]
    heights = fit_ground([*level, hill, *cliff], wide)
    assert steepest_deg(wide, heights) <= MAX_SLOPE_DEG
    assert steepest_deg(wide, heights) > MAX_SLOPE_DEG - 4
    np.testing.assert_allclose(wide.sample(heights, hill), 0.05, atol=FOOT_SD / 2)


@pytest.mark.release
@pytest.mark.parametrize("terrain", [12])
def test_published_rocks_stand_on_a_ground_without_cliffs(release_root, terrain):
    """With inverse distances, the steepest triangles had 76 and 70 degrees."""
    paths = obj.rock_files(release_root / "TerrainMeshes" / f"Terrain{terrain:02d}").values()
    rims = [rim(cleaned(obj.read_obj(path))) for path in paths]
    grid = FloorGrid(Extent(-2.1, -2.1, 2.1, 2.1), 0.02)
    heights = fit_ground(rims, grid)
    assert steepest_deg(grid, heights) <= MAX_SLOPE_DEG
    gaps = [np.median(np.abs(own[:, 2] - grid.sample(heights, own))) for own in rims]
    assert np.median(gaps) < FOOT_SD

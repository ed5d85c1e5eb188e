import numpy as np
import pytest

from polarsim.analog.ground import CRATER_CENTRE, HeightField, make_ground, pile_sand
from polarsim.analog.presets import PRESETS
from polarsim.analog.sandbox import HALL_FLOOR

HALF_WIDTH = (2.0, 2.0)


@pytest.mark.parametrize("terrain", [1, 6, 9])
def test_sand_has_height_zero_at_the_centre_and_low_relief(terrain):
    ground = make_ground(PRESETS[terrain], HALF_WIDTH, 0.02, np.random.default_rng(terrain))
    assert abs(ground.height_at(np.zeros(1), np.zeros(1))[0]) < 0.02
    assert np.abs(ground.heights).max() < 0.15
    assert ground.x[0] <= -2
    assert ground.y[-1] >= 2
    if terrain == 6:  # smooth, in contrast to a trowelled terrain
        rough = make_ground(PRESETS[1], HALF_WIDTH, 0.02, np.random.default_rng(3))
        assert np.abs(np.diff(ground.heights)).mean() < 0.5 * np.abs(np.diff(rough.heights)).mean()


def test_a_fresh_crater_is_a_bowl_two_metres_wide_with_a_raised_rim():
    ground = make_ground(PRESETS[11], HALF_WIDTH, 0.02, np.random.default_rng(3))
    angle = np.linspace(0, 2 * np.pi, 72, endpoint=False)

    def ring(radius):
        return ground.height_at(CRATER_CENTRE[0] + radius * np.cos(angle), CRATER_CENTRE[1] + radius * np.sin(angle))

    profile = {radius: np.median(ring(radius)) for radius in (0.1, 0.5, 1.0, 1.5)}
    assert profile[0.1] < -0.15
    assert profile[0.1] < profile[0.5] < profile[1.0]
    assert profile[1.0] > profile[1.5] + 0.04


def test_heights_between_nodes_are_bilinear_and_the_mesh_faces_up():
    x, y = np.linspace(-1, 1, 5), np.linspace(-2, 2, 6)
    plane = HeightField(x, y, 0.1 * x[:, None] + 0.2 * y[None, :])
    np.testing.assert_allclose(plane.height_at(np.array([0.3]), np.array([-0.7])), [0.03 - 0.14])
    vertices, faces = plane.mesh()
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    np.testing.assert_allclose(plane.height_at(vertices[:, 0], vertices[:, 1]), vertices[:, 2], atol=1e-12)


def test_sand_is_piled_around_a_rock_only():
    axis = np.linspace(-1, 1, 201)
    flat = HeightField(axis, axis, np.zeros((201, 201)))
    piled = pile_sand(flat, np.random.default_rng(1), np.array([[0.2, 0.3]]), np.array([0.1]))
    foot = piled.height_at(np.array([0.3]), np.array([0.3]))[0]
    assert 0 < piled.heights.max() < 0.03
    assert foot > -0.01
    assert piled.height_at(np.array([-0.5]), np.array([0.3]))[0] == 0


@pytest.mark.parametrize("terrain", [number for number, preset in PRESETS.items() if preset.crater])
def test_no_crater_reaches_the_floor_of_the_hall(terrain):
    for seed in range(3):
        ground = make_ground(PRESETS[terrain], HALF_WIDTH, 0.02, np.random.default_rng(seed))
        assert ground.heights.min() > HALL_FLOOR + 0.02


@pytest.mark.parametrize("terrain", [3, 11])
def test_the_sand_of_another_yard_has_its_size_and_the_same_relief(terrain):
    usual, long = (
        make_ground(PRESETS[terrain], half, 0.02, np.random.default_rng(5)) for half in (HALF_WIDTH, (1.5, 3.0))
    )
    assert (long.x[-1], long.y[-1]) == pytest.approx((1.53, 3.03))
    assert long.heights.shape == pytest.approx((154, 304), abs=2)
    np.testing.assert_allclose(long.steps, 0.02, rtol=0.02)
    rough = [np.abs(np.diff(ground.heights, axis=axis)).mean() for ground in (usual, long) for axis in (0, 1)]
    assert max(rough) < 1.35 * min(rough)
    assert long.heights.min() > HALL_FLOOR + 0.02

"""Loops over hits, compiled and in NumPy, equal the same steps on vectors bit for bit."""

import numpy as np
import pytest

from polarsim.geometry.vectors import dot, length, normalise, points_along, scale_vectors
from polarsim.render import hit_arrays, hit_kernels
from polarsim.render.hits import MIN_FACING, NO_NORMAL

COUNT = 5000


@pytest.fixture(params=[hit_kernels, hit_arrays], ids=["numba", "numpy"])
def loops(request):
    return request.param


def vectors(rng, count=COUNT, dtype=np.float32):
    return rng.normal(size=(count, 3)).astype(dtype)


@pytest.mark.parametrize("same", [True, False])
def test_points_and_vectors_back(loops, rng, same):
    directions, ray = vectors(rng, dtype=float), np.sort(rng.choice(COUNT, COUNT // 2, replace=False))
    origins = rng.normal(size=(1 if same else COUNT, 3))
    distance = rng.random(len(ray)).astype(np.float32)
    point, to_viewer = np.empty((2, 3 * len(ray)), np.float32)
    loops.hit_points(ray, distance, origins.reshape(-1), directions.reshape(-1), point, to_viewer)
    starts = origins if same else origins[ray]
    expected = points_along(np.broadcast_to(starts, (len(ray), 3)), directions[ray], distance).astype(np.float32)
    np.testing.assert_array_equal(point.reshape(-1, 3), expected)
    np.testing.assert_array_equal(to_viewer.reshape(-1, 3), normalise(-directions[ray].astype(np.float32)))


def test_normals_of_faces_and_between_corners(loops, rng):
    to_viewer, raw, corners = normalise(vectors(rng)), vectors(rng), normalise(vectors(rng, 300)).reshape(100, 3, 3)
    raw[0] = 0
    corners[0] = [[0, 0, 1], [0, 0, -1], [0, 0, 1]]  # cancel out at weights of a half
    face, weights = rng.integers(0, 100, COUNT), rng.dirichlet([1, 1, 1], COUNT)[:, :2].astype(np.float32)
    face[1], weights[1] = 0, (0.5, 0)
    plane, normal = np.empty((2, 3 * COUNT), np.float32)
    side = np.empty(COUNT, np.float32)
    loops.planes(raw.reshape(-1), to_viewer.reshape(-1), plane, side)
    flat = normalise(raw)
    expected_side = np.where(dot(flat, to_viewer) < 0, np.float32(-1), np.float32(1))
    np.testing.assert_array_equal(side, expected_side)
    np.testing.assert_array_equal(plane.reshape(-1, 3), scale_vectors(flat, expected_side))
    limits = np.float32(NO_NORMAL), np.float32(MIN_FACING)
    arrays = corners.reshape(-1), side, plane, to_viewer.reshape(-1)
    loops.smooth_normals(face, weights.reshape(-1), *arrays, *limits, normal)
    second, third = weights.T
    first = 1 - second - third
    own = corners[face]
    between = scale_vectors(own[:, 0], first) + scale_vectors(own[:, 1], second) + scale_vectors(own[:, 2], third)
    smooth = scale_vectors(
        scale_vectors(normalise(between), (dot(between, between) > NO_NORMAL).astype(np.float32)), side
    )
    away = dot(smooth, to_viewer) < MIN_FACING
    assert away[1]
    assert 0.1 < away.mean() < 0.9
    smooth[away] = plane.reshape(-1, 3)[away]
    np.testing.assert_array_equal(normal.reshape(-1, 3), smooth)


def test_light_that_points_receive(loops, rng):
    plane, normal, to_lamp = (vectors(rng) for _ in range(3))
    irradiance = rng.random(COUNT).astype(np.float32)
    irradiance[::7] = 0
    flat = [array.reshape(-1) for array in (plane, normal, to_lamp)]
    lit = np.empty(COUNT, np.int64)
    lit = lit[: loops.facing(*flat, irradiance, lit)]
    expected = np.flatnonzero((dot(plane, to_lamp) > 0) & (dot(normal, to_lamp) > 0) & (irradiance > 0))
    np.testing.assert_array_equal(lit, expected)
    hidden = rng.random(len(lit)) < 0.5
    lit = lit[: loops.kept(lit, hidden)]
    expected = expected[~hidden]
    np.testing.assert_array_equal(lit, expected)
    direction, received = np.empty((len(lit), 3), np.float32), np.empty(len(lit), np.float32)
    loops.beams(lit, *flat[1:], irradiance, direction.reshape(-1), received)
    nearness = 1 / length(to_lamp[lit])
    np.testing.assert_array_equal(direction, scale_vectors(to_lamp[lit], nearness))
    np.testing.assert_array_equal(received, irradiance[lit] * dot(normal, to_lamp)[lit] * nearness)
    np.testing.assert_array_equal(loops.rows(to_lamp, lit), to_lamp[lit])


def test_add_accumulates_values_times_shares(loops, rng):
    strip, pixel = rng.random(COUNT).astype(np.float32), rng.permutation(COUNT)[:1000]
    value, share = rng.random((2, 1000)).astype(np.float32)
    expected = strip.copy()
    expected[pixel] += value * share
    loops.add(strip, pixel, value, share)
    np.testing.assert_array_equal(strip, expected)


def test_rotated_vectors(loops, rng):
    rotation, given = np.linalg.qr(rng.normal(size=(3, 3)))[0], vectors(rng, dtype=float)
    out = np.empty_like(given)
    loops.rotated(rotation.reshape(-1), given.reshape(-1), out.reshape(-1))
    np.testing.assert_allclose(out, given @ rotation.T, rtol=0, atol=1e-14)

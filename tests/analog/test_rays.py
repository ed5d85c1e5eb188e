import numpy as np
import pytest

from polarsim.analog.rays import RayCaster

STEPS = np.array([0.2, 0.5, 0.9])  # heights of three squares above the origin


@pytest.fixture
def squares():
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])
    vertices = np.concatenate([np.column_stack([corners, np.full(4, height)]) for height in STEPS])
    faces = np.concatenate([4 * k + np.array([[0, 1, 2], [0, 2, 3]]) for k in range(3)])
    return RayCaster(vertices, faces)


def test_all_hits_are_listed_up_to_the_tip_of_the_direction(squares):
    origins = np.array([[0.3, -0.2, 0], [-0.5, 0.1, 0.3], [0.4, 0.4, 0], [5.0, 5.0, 0]])
    directions = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 0.6], [0, 0, 1.0]])
    ray, face = squares.all_hits(origins, directions)
    found = sorted(zip(ray.tolist(), (face // 2).tolist(), strict=True))
    assert found == [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 0), (2, 1)]


def test_rays_without_hit_have_no_distance_and_the_shape_of_the_directions(squares):
    directions = np.array([[[0, 0, 1.0], [0, 0, -1.0]]] * 3)
    hits = squares.first_hits(np.zeros(3), directions)
    assert hits.distance.shape == hits.face.shape == (3, 2)
    np.testing.assert_allclose(hits.distance[:, 0], STEPS[0], rtol=1e-6)
    assert np.isinf(hits.distance[:, 1]).all()
    assert not hits.is_hit[:, 1].any()
    assert (squares.occluded(np.zeros(3), directions) == hits.is_hit).all()


def test_no_rays_have_no_hits(squares):
    none = np.zeros((0, 3))
    assert squares.first_hits(none, none).distance.shape == (0,)
    assert squares.occluded(none, none).shape == (0,)
    assert [len(part) for part in squares.all_hits(none, none)] == [0, 0]

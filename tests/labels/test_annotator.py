import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.labels.annotator import as_people_draw

WIDTH = 1936
corner = st.floats(100, 1500)
side = st.floats(12, 300)


@st.composite
def box(draw):
    x, y = draw(corner), draw(corner)
    return np.array([x, y, x + draw(side), y + draw(side)])


def mirrored(box):
    return np.array([WIDTH - box[2], box[1], WIDTH - box[0], box[3]])


@given(box(), box(), st.floats(200, 1200))
def test_left_and_right_are_alike(shadow, rock, px_per_m):
    found = as_people_draw(shadow, rock, rock, px_per_m)
    flipped = as_people_draw(mirrored(shadow), mirrored(rock), mirrored(rock), px_per_m)
    np.testing.assert_allclose(flipped, mirrored(found), atol=1e-9)


@given(st.floats(-300, 300), st.floats(-300, 300))
def test_the_position_in_the_photo_does_not_matter(dx, dy):
    rock, shadow, offset = (
        np.array([500.0, 400, 560, 450]),
        np.array([550.0, 420, 680, 448]),
        np.array([dx, dy, dx, dy]),
    )
    found = as_people_draw(shadow, rock, rock, 600)
    np.testing.assert_allclose(as_people_draw(shadow + offset, rock + offset, rock + offset, 600), found + offset)


def test_people_begin_a_shadow_farther_from_the_centre_of_its_rock_than_its_visible_part():
    # Facts on the labels, 2.6: with the lamp at the side the near edge lies at 0.75 to 0.93 of the rock's width.
    rock, shadow = np.array([500.0, 400, 560, 450]), np.array([530.0, 420, 680, 448])
    found = as_people_draw(shadow, rock, rock, 600)
    assert 0.5 < (found[0] - rock[0]) / 60 < 0.93
    assert found[2] < shadow[2] + 30


def test_a_label_higher_than_the_mesh_widens_the_side_of_the_shadow():
    rock, shadow = np.array([500.0, 400, 560, 450]), np.array([550.0, 420, 680, 448])
    taller = rock - np.array([0, 10, 0, 0])
    higher = as_people_draw(shadow, taller, rock, 600)[1] - as_people_draw(shadow, taller, taller, 600)[1]
    assert -10 < higher < -3

import numpy as np
import pytest

from polarsim.rocks.creases import Joining, Relief, basins, cut_along_creases, depths_below_hull, neighbours

CELL = 0.005  # metres
Y, X = np.mgrid[0:60, 0:90] * CELL


def ball(x, y, radius, sunk=0.0):
    """Return heights of a ball with its centre `sunk` metres below the ground."""
    return np.sqrt(np.clip(radius**2 - (X - x) ** 2 - (Y - y) ** 2, 0, None)) - sunk


def relief_of(above):
    return Relief(np.maximum(above, 0), np.ones(above.shape, bool), CELL)


def halves(above):
    """Return the terms of the two pieces left and right of the centre."""
    parts = np.where(above > 0.006, np.where(X.mean() > X, 1, 2), 0)
    return dict(zip(TERM_NAMES, Joining(relief_of(above), parts).pairs[1, 2], strict=True))


TERM_NAMES = ("folded", "hidden", "opened", "notched", "area", "ratio")


def test_basins_meet_at_the_pass_between_them():
    values = np.array([[3.0, 0.0, 1.0, 5.0, 2.0, 1.0, 4.0]])
    labels = np.ones(values.shape, int)
    numbers = basins(values, labels, 3.5)[0]
    assert numbers[0] == numbers[1] == numbers[2] != numbers[4] == numbers[5] == numbers[6]
    assert len(np.unique(basins(values, labels, 4.5))) == 1  # the right basin is only 4 deep


def test_a_crease_separates_pieces_without_two_peaks():
    # A gentle slab against a steep flank: heights decrease monotonically, so that a merge tree of heights fails.
    steep, gentle = 0.14 - 2.0 * np.maximum(X - 0.1, 0), 0.06 - 0.2 * (X - 0.14)
    above = np.where((X > 0.05) & (X < 0.3) & (Y > 0.05) & (Y < 0.25), np.maximum(steep, gentle), 0)
    assert (np.diff(above[30, 11:]) <= 0).all()
    pieces = cut_along_creases(relief_of(above), (above > 0.006).astype(int))
    assert pieces[30, 24] != pieces[30, 45]  # flank and slab


def test_a_ball_is_one_piece():
    above = ball(0.2, 0.15, 0.1)
    labels = (above > 0.006).astype(int)
    np.testing.assert_array_equal(cut_along_creases(relief_of(above), labels), labels)


def test_a_valley_is_a_fold_but_a_roof_is_not():
    for slope, folded in ((0.5, 1), (0.08, 0)):  # 53 degrees, and 9, which is below the limit
        roof = 0.12 - slope * np.abs(X - X.mean())
        valley = 0.02 + slope * np.abs(X - X.mean())
        assert (halves(roof)["folded"], halves(valley)["folded"]) == (0, folded)


def test_only_the_hull_of_two_bodies_is_hollow():
    one = ball(X.mean(), 0.15, 0.1)
    two = np.maximum(ball(X.mean() - 0.08, 0.15, 0.09), ball(X.mean() + 0.08, 0.15, 0.09))
    assert halves(one)["opened"] < 0.01 < 0.05 < halves(two)["opened"]
    assert halves(one)["notched"] < 0.01 < 0.04 < halves(two)["notched"]


def test_a_rough_body_does_not_open_the_hull():
    rough = ball(X.mean(), 0.15, 0.1) * (1 - 0.3 * np.sin(X / 0.003) ** 2)
    terms = halves(rough)
    assert terms["opened"] < 0.01
    hollow = depths_below_hull(np.stack([X, Y, rough], axis=-1)[rough > 0.006]).mean()
    assert hollow / rough.max() > 0.05  # although the hull is not full


def test_depth_below_the_hull_of_a_pit():
    # A flat top of 5 x 5 points with the centre 7 mm lower.
    points = np.array([[x, y, 0.05] for x in range(5) for y in range(5)], float) * [0.01, 0.01, 1]
    points[12, 2] -= 0.007
    depths = depths_below_hull(points)
    assert depths[12] == pytest.approx(0.007, abs=1e-9)
    assert np.delete(depths, 12).max() < 1e-9


def test_a_joined_body_has_the_neighbours_of_both():
    parts = np.repeat(np.array([[1, 1, 2, 2, 3, 3, 4, 4]]), 8, axis=0).repeat(3, axis=1)
    joining = Joining(Relief(np.full(parts.shape, 0.05), np.ones(parts.shape, bool), CELL), parts)
    joining.join(3, 2)
    assert set(joining.pairs) == {(1, 2), (2, 4)}
    assert neighbours(joining.parts) == {(1, 2), (2, 4)}
    assert (joining.parts == 3).sum() == 0
    np.testing.assert_allclose(joining.pairs[1, 2][-1], np.log(2))  # 12 and 6 columns


def test_the_most_likely_pair_is_joined_first_below_the_limit():
    parts = np.repeat(np.array([[1, 1, 1, 2, 2, 2, 3, 3, 3]]), 8, axis=0)
    joining = Joining(Relief(np.full(parts.shape, 0.05), np.ones(parts.shape, bool), CELL), parts)
    seen = []

    def of_two(terms):
        seen.append(len(terms))
        return np.array([0.4, 0.2]) if len(terms) == 2 else np.array([0.3])

    after = joining.join_below(0.3, of_two)
    assert after[0].tolist() == [1, 1, 1, 2, 2, 2, 2, 2, 2]
    assert seen == [2, 1]

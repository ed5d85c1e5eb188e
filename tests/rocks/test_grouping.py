"""Grouping of pieces in a row, 10 px wide each, in one or two photos."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rocks.grouping import MAX_EXHAUSTIVE_PIECES, group_pieces


def span(first, last, top=0.0):
    """Return the box around pieces of the row."""
    return [10.0 * first, top, 10.0 * last + 10, top + 12]


def row(n):
    return np.array([span(k, k) for k in range(n)])


def groups(rock, *annotated, boxes=None, touching=None):
    """Return the sets of pieces after grouping by the boxes of each photo."""
    n = len(rock)
    boxes = [row(n)] * len(annotated) if boxes is None else boxes
    touching = [(k, k + 1) for k in range(n - 1)] if touching is None else touching
    names = "ABC"[: len(annotated)]
    found = group_pieces(
        np.array(rock),
        touching,
        dict(zip(names, boxes, strict=True)),
        {name: np.array(one, float).reshape(-1, 4) for name, one in zip(names, annotated, strict=True)},
        0.3,
    )
    return {frozenset(np.flatnonzero(found == number).tolist()) for number in found}


def test_a_rock_that_was_annotated_as_two_is_two():
    assert groups([1, 1, 1], [span(0, 1), span(2, 2)]) == {frozenset({0, 1}), frozenset({2})}


def test_two_rocks_that_were_annotated_as_one_are_one():
    assert groups([1, 2], [span(0, 1)]) == {frozenset({0, 1})}


def test_a_box_on_a_part_of_a_rock_does_not_cut_it():
    assert groups([1, 1, 1], [span(0, 1)]) == {frozenset({0, 1, 2})}  # the remainder is not annotated


def test_a_piece_is_moved_to_the_rock_with_the_box_around_it():
    assert groups([1, 1, 2, 2, 2], [span(0, 2), span(3, 4)]) == {frozenset({0, 1, 2}), frozenset({3, 4})}


def test_a_second_photo_can_resolve_an_ambiguity():
    behind = np.array([span(0, 0), span(0, 0)])  # one piece occludes the other
    one_box, two_boxes = [span(0, 0)], [span(0, 0), span(1, 1)]
    assert groups([1, 1], one_box, two_boxes, boxes=[behind, row(2)]) == {frozenset({0}), frozenset({1})}


def test_an_unannotated_piece_next_to_an_annotated_rock_is_separated_if_the_fit_is_equal():
    assert groups([1, 2], [span(0, 0)]) == {frozenset({0}), frozenset({1})}
    in_front = np.array([span(0, 0), [2.0, 4, 8, 10]])
    assert groups([1, 2], [span(0, 0)], boxes=[in_front]) == {frozenset({0, 1})}


def test_rocks_that_do_not_touch_are_never_joined():
    assert groups([1, 2], [span(0, 1)], touching=[]) == {frozenset({0}), frozenset({1})}


def test_pieces_outside_all_photos_keep_their_rock():
    hidden = np.vstack([row(2), np.full((1, 4), np.nan)])
    assert groups([1, 1, 1], [span(0, 0), span(1, 1)], boxes=[hidden], touching=[(0, 1), (1, 2)]) == {
        frozenset({0}),
        frozenset({1, 2}),
    }


@pytest.mark.parametrize("n", [MAX_EXHAUSTIVE_PIECES, MAX_EXHAUSTIVE_PIECES + 3])
def test_rocks_of_many_pieces_are_cut_too(n):
    assert groups([1] * n, [span(0, n - 2), span(n - 1, n - 1)]) == {frozenset(range(n - 1)), frozenset({n - 1})}


def test_ties_are_not_broken_by_the_numbers_of_pieces():
    """Two exchanges fit equally well in this case."""
    check_that_order_does_not_matter([3, 2, 1, 3, 2], 2, np.array([1, 0, 2, 3, 4]))


@given(rock=st.lists(st.integers(1, 3), min_size=2, max_size=6), cut=st.integers(1, 5), data=st.data())
def test_the_order_of_pieces_does_not_matter(rock, cut, data):
    check_that_order_does_not_matter(rock, cut, np.array(data.draw(st.permutations(range(len(rock))))))


def check_that_order_does_not_matter(rock, cut, order):
    n = len(rock)
    annotated = [span(0, min(cut, n - 1) - 1), span(min(cut, n - 1), n - 1)]
    position = np.argsort(order)
    shuffled = groups(
        np.array(rock)[order],
        annotated,
        boxes=[row(n)[order]],
        touching=[(int(position[k]), int(position[k + 1])) for k in range(n - 1)],
    )
    assert {frozenset(order[list(group)].tolist()) for group in shuffled} == groups(rock, annotated)

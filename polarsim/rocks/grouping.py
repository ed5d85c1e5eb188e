"""Pieces of what stands out of the sand made rocks: as shape has it, unless people drew them otherwise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from polarsim.geometry.boxes import iou
from polarsim.rocks.evidence import PEN_IOU

PRICE = 0.06  # of IoU a position that a rock costs: two are not taken where one explains the boxes as well
TIE = 1e-9  # of IoU: rounding
MOST_PIECES = 12  # of a rock that is looked at in all ways to cut it in two; from larger ones single pieces are cut
Group = frozenset[int]  # numbers of pieces
Grouping = frozenset[Group]


def grouped(
    rock: np.ndarray,
    touching: Sequence[tuple[int, int]],
    boxes: Mapping[str, np.ndarray],
    annotated: Mapping[str, np.ndarray],
    min_iou: float,
) -> np.ndarray:
    """(n,) number of the rock of each of n pieces, after the boxes that people drew were looked at.

    Rocks that touch are joined, cut in two, or exchange a piece, the best change first, as long as their boxes fit the
    annotated ones clearly better by it.

    Parameters
    ----------
    rock : (n,) int
        The same by shape.
    touching : pairs of pieces
    boxes : position -> (n, 4) float
        Around the pieces, in pixels; NaN for one that the photo does not show.
    annotated : position -> (m, 4) float
        One box a rock.
    min_iou : float
        Least overlap of a rock's box with an annotated one that is its own.
    """
    result, free = rock.copy(), int(rock.max(initial=0)) + 1
    for pieces, pairs in _clusters(rock, touching) if annotated else ():
        numbers = np.unique(rock[pieces])
        by_shape = frozenset(frozenset(pieces[rock[pieces] == number].tolist()) for number in numbers)
        by_boxes = _Cluster(pairs, boxes, annotated, min_iou).improved(by_shape)
        for group in sorted(by_boxes - by_shape, key=min):
            result[list(group)] = free
            free += 1
    return result


def _clusters(
    rock: np.ndarray, touching: Sequence[tuple[int, int]]
) -> Iterator[tuple[np.ndarray, set[tuple[int, int]]]]:
    """Pieces that hang together, by touch or as one rock, and those pairs of them that touch; none of single pieces."""
    order = np.argsort(rock, kind="stable")
    following = np.stack([order[:-1], order[1:]], axis=1)
    same_rock = following[rock[following[:, 0]] == rock[following[:, 1]]]
    links = np.concatenate([np.array(touching, int).reshape(-1, 2), same_rock])
    graph = coo_array((np.ones(len(links), bool), (links[:, 0], links[:, 1])), shape=(len(rock), len(rock)))
    count, cluster = connected_components(graph, directed=False)
    for number in range(count):
        pieces = np.flatnonzero(cluster == number)
        if len(pieces) > 1:
            yield pieces, {(one, other) for one, other in touching if cluster[one] == number}


@dataclass(frozen=True)
class _Cluster:
    """Pieces that hang together, and how well groups of them fit the annotated boxes."""

    touching: set[tuple[int, int]]
    boxes: Mapping[str, np.ndarray]
    annotated: Mapping[str, np.ndarray]
    min_iou: float
    overlaps: dict[Group, dict[str, np.ndarray]] = field(default_factory=dict)

    def improved(self, grouping: Grouping) -> Grouping:
        """The grouping after all changes that make it fit clearly better."""
        worth = self._worth(grouping)
        while True:
            tried = [(self._worth(other), other) for other in self._changed(grouping)]
            best = max((one for one, _ in tried), default=worth)
            if best < worth + PEN_IOU * len(self.annotated):
                return grouping
            worth, grouping = best, min((other for one, other in tried if one > best - TIE), key=self._outline)

    def _outline(self, grouping: Grouping) -> list[list[list[float]]]:
        """What tells groupings that fit alike apart, whatever numbers their pieces have: where these lie in photos."""
        pieces = np.nan_to_num(np.concatenate([self.boxes[position] for position in sorted(self.boxes)], axis=1))
        return sorted(sorted(pieces[piece].tolist() for piece in group) for group in grouping)

    def _worth(self, grouping: Grouping) -> float:
        """Sum over positions of the IoU of groups with the boxes that are theirs, less what the groups cost."""
        total = -PRICE * len(self.annotated) * len(grouping)
        groups = _ordered(grouping)
        for position in self.annotated:
            overlap = np.array([self._overlap(group)[position] for group in groups])
            rows, columns = linear_sum_assignment(-overlap)
            total += float(overlap[rows, columns].sum())
        return total

    def _overlap(self, group: Group) -> dict[str, np.ndarray]:
        """(m,) IoU of a group's box with the annotated boxes of each position; 0 where they do not belong together."""
        if group not in self.overlaps:
            numbers = sorted(group)
            self.overlaps[group] = {
                position: _overlap(self.boxes[position][numbers], annotated, self.min_iou)
                for position, annotated in self.annotated.items()
            }
        return self.overlaps[group]

    def _is_annotated(self, group: Group) -> bool:
        return any(overlap.any() for overlap in self._overlap(group).values())

    def _changed(self, grouping: Grouping) -> Iterator[Grouping]:
        """Groupings one step away, in an order that is always the same."""
        groups = _ordered(grouping)
        for one, other in combinations(groups, 2):
            if not self._touch(one, other):
                continue
            rest = grouping - {one, other}
            yield rest | {one | other}
            for giver, taker in ((one, other), (other, one)):
                for piece in sorted(giver) if len(giver) > 1 else ():
                    if self._touch(frozenset({piece}), taker):
                        yield rest | {giver - {piece}, taker | {piece}}
        for group in groups:
            for half in self._halves(group):
                if self._is_annotated(half) and self._is_annotated(group - half):
                    yield grouping - {group} | {half, group - half}

    def _halves(self, group: Group) -> Iterator[Group]:
        """One half of every way to cut a group into two that each hang together."""
        others = sorted(group)[1:]
        for size in range(1, len(group)) if len(group) <= MOST_PIECES else (1,):
            for chosen in combinations(others, size):
                half = frozenset(chosen)
                if self._hangs_together(half) and self._hangs_together(group - half):
                    yield half

    def _touch(self, one: Group, other: Group) -> bool:
        return any((a in one and b in other) or (a in other and b in one) for a, b in self.touching)

    def _hangs_together(self, group: Group) -> bool:
        reached, border = {min(group)}, {min(group)}
        while border:
            border = {
                piece for pair in self.touching if group.issuperset(pair) and border & set(pair) for piece in pair
            } - reached
            reached |= border
        return reached == group


def _ordered(grouping: Grouping) -> list[Group]:
    return sorted(grouping, key=min)


def _overlap(boxes: np.ndarray, annotated: np.ndarray, min_iou: float) -> np.ndarray:
    """(m,) IoU of the box around boxes (k, 4) with annotated boxes (m, 4), 0 below `min_iou`."""
    shown = boxes[np.isfinite(boxes).all(axis=1)]
    if not len(shown):
        return np.zeros(len(annotated))
    whole = np.concatenate([shown[:, :2].min(axis=0), shown[:, 2:].max(axis=0)])
    overlap = iou(whole[None], annotated)[0]
    return np.where(overlap >= min_iou, overlap, 0.0)

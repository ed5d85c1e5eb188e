"""Grouping of pieces into rocks: by shape, unless annotated boxes contradict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment

from polarsim.geometry.boxes import iou
from polarsim.geometry.topology import linked_parts
from polarsim.rocks.evidence import ANNOTATION_IOU

ROCK_COST = 0.06  # IoU per position that each rock costs: two rocks must explain the boxes better than one
TIE = 1e-9  # IoU: rounding errors
MAX_EXHAUSTIVE_PIECES = 12  # larger rocks are only cut by single pieces, not in all ways
Group = frozenset[int]  # numbers of pieces
Grouping = frozenset[Group]


def group_pieces(
    rock: np.ndarray,
    touching: Sequence[tuple[int, int]],
    boxes: Mapping[str, np.ndarray],
    annotated: Mapping[str, np.ndarray],
    min_iou: float,
) -> np.ndarray:
    """Return the rock number (n,) of each of n pieces, corrected by annotated boxes.

    Rocks that touch are joined, cut in two, or exchange a piece, the best change first, while their boxes fit the
    annotated boxes clearly better.

    `rock` (n,): rock numbers by shape.
    `boxes`, position -> (n, 4): boxes around the pieces, pixels; NaN for pieces that the photo does not show.
    `annotated`, position -> (m, 4): one box per rock.
    `min_iou`: minimum IoU of matching boxes.
    """
    result, free = rock.copy(), int(rock.max(initial=0)) + 1
    for pieces, pairs in _clusters(rock, touching) if annotated else ():
        numbers = np.unique(rock[pieces])
        by_shape = frozenset(frozenset(pieces[rock[pieces] == number].tolist()) for number in numbers)
        by_boxes = _Cluster(pairs, boxes, annotated, min_iou).improve(by_shape)
        for group in sorted(by_boxes - by_shape, key=min):
            result[list(group)] = free
            free += 1
    return result


def _clusters(
    rock: np.ndarray, touching: Sequence[tuple[int, int]]
) -> Iterator[tuple[np.ndarray, set[tuple[int, int]]]]:
    """Yield connected pieces, by touch or as parts of one rock, and their touching pairs; no single pieces."""
    order = np.argsort(rock, kind="stable")
    following = np.stack([order[:-1], order[1:]], axis=1)
    same_rock = following[rock[following[:, 0]] == rock[following[:, 1]]]
    links = np.concatenate([np.array(touching, int).reshape(-1, 2), same_rock])
    cluster = linked_parts(links, len(rock))
    for number in range(cluster.max(initial=-1) + 1):
        pieces = np.flatnonzero(cluster == number)
        if len(pieces) > 1:
            yield pieces, {(first, second) for first, second in touching if cluster[first] == number}


@dataclass(frozen=True)
class _Cluster:
    """Connected pieces, and the fit of groups of them with the annotated boxes."""

    touching: set[tuple[int, int]]
    boxes: Mapping[str, np.ndarray]
    annotated: Mapping[str, np.ndarray]
    min_iou: float
    overlaps: dict[Group, dict[str, np.ndarray]] = field(default_factory=dict)

    def improve(self, grouping: Grouping) -> Grouping:
        """Return the grouping after all changes that improve its fit clearly."""
        score = self._score(grouping)
        while True:
            tried = [(self._score(candidate), candidate) for candidate in self._changes(grouping)]
            best = max((candidate_score for candidate_score, _ in tried), default=score)
            if best < score + ANNOTATION_IOU * len(self.annotated):
                return grouping
            score, grouping = (
                best,
                min(
                    (candidate for candidate_score, candidate in tried if candidate_score > best - TIE),
                    key=self._outline,
                ),
            )

    def _outline(self, grouping: Grouping) -> list[list[list[float]]]:
        """Return a sort key of equally good groupings that does not depend on the numbers of pieces: their boxes."""
        pieces = np.nan_to_num(np.concatenate([self.boxes[position] for position in sorted(self.boxes)], axis=1))
        return sorted(sorted(pieces[piece].tolist() for piece in group) for group in grouping)

    def _score(self, grouping: Grouping) -> float:
        """Return the sum over positions of the IoU of groups with their boxes, minus the cost of the groups."""
        total = -ROCK_COST * len(self.annotated) * len(grouping)
        groups = _ordered(grouping)
        for position in self.annotated:
            overlap = np.array([self._overlap(group)[position] for group in groups])
            rows, columns = linear_sum_assignment(-overlap)
            total += float(overlap[rows, columns].sum())
        return total

    def _overlap(self, group: Group) -> dict[str, np.ndarray]:
        """Return IoU (m,) of a group's box with the annotated boxes of each position; 0 below the minimum."""
        if group not in self.overlaps:
            numbers = sorted(group)
            self.overlaps[group] = {
                position: _overlap(self.boxes[position][numbers], annotated, self.min_iou)
                for position, annotated in self.annotated.items()
            }
        return self.overlaps[group]

    def _is_annotated(self, group: Group) -> bool:
        return any(overlap.any() for overlap in self._overlap(group).values())

    def _changes(self, grouping: Grouping) -> Iterator[Grouping]:
        """Yield groupings one step away, in a fixed order."""
        groups = _ordered(grouping)
        for first, second in combinations(groups, 2):
            if not self._touch(first, second):
                continue
            rest = grouping - {first, second}
            yield rest | {first | second}
            for giver, taker in ((first, second), (second, first)):
                for piece in sorted(giver) if len(giver) > 1 else ():
                    if self._touch(frozenset({piece}), taker):
                        yield rest | {giver - {piece}, taker | {piece}}
        for group in groups:
            for half in self._halves(group):
                if self._is_annotated(half) and self._is_annotated(group - half):
                    yield grouping - {group} | {half, group - half}

    def _halves(self, group: Group) -> Iterator[Group]:
        """Yield one half of every division of a group into two connected halves."""
        others = sorted(group)[1:]
        for size in range(1, len(group)) if len(group) <= MAX_EXHAUSTIVE_PIECES else (1,):
            for chosen in combinations(others, size):
                half = frozenset(chosen)
                if self._hangs_together(half) and self._hangs_together(group - half):
                    yield half

    def _touch(self, first: Group, second: Group) -> bool:
        return any((a in first and b in second) or (a in second and b in first) for a, b in self.touching)

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
    """Return IoU (m,) of the box around boxes (k, 4) with annotated boxes (m, 4), 0 below `min_iou`."""
    shown = boxes[np.isfinite(boxes).all(axis=1)]
    if not len(shown):
        return np.zeros(len(annotated))
    whole = np.concatenate([shown[:, :2].min(axis=0), shown[:, 2:].max(axis=0)])
    overlap = iou(whole[None], annotated)[0]
    return np.where(overlap >= min_iou, overlap, 0.0)

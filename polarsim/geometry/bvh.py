"""Bounding volume hierarchy of triangles, built with NumPy and traversed by `rays_taichi`.

Binned surface-area heuristic (Wald, IEEE Symposium on Interactive Ray Tracing 2007, 33), all nodes of a level at once.
The tree depends only on the triangles, not on random numbers or threads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAF = 4  # maximum number of triangles of a leaf
LEVELS = 40  # maximum number of inner nodes from the root to a leaf: size of the stack of a traversal
COUNT_BITS = 3  # bits of a leaf's code that store its number of triangles
_MAX_TRIANGLES = 1 << (31 - COUNT_BITS)  # number of triangles that a leaf's code can address
_BINS = 16  # number of tried cuts of a node
_FEW_BINS = 4  # number of tried cuts of small nodes


@dataclass(frozen=True)
class Tree:
    """Inner nodes, parents before children, root first; each stores the boxes of its two children.

    boxes : (m, 4, 3) float32
        Low and high corner of the first child's box, low and high corner of the second child's box.
    children : (m, 2) int32
        Index of an inner node, or negative code of a leaf: see `_code`.
    order : (f,) int32
        Numbers of the triangles; the triangles of a leaf are adjacent.
    """

    boxes: np.ndarray
    children: np.ndarray
    order: np.ndarray


def _code(first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return codes of leaves from their first index in the tree's order and their number of triangles."""
    return ~((first << COUNT_BITS) | count)


@dataclass
class _Level:
    """Nodes of a level that will be cut, and their triangles, node after node."""

    low: list[np.ndarray]  # three arrays (k,) by axis: low corners of the triangles' boxes
    high: list[np.ndarray]
    triangle: np.ndarray  # (k,) numbers of the triangles
    start: np.ndarray  # (n,) first triangle of each node, in these arrays
    count: np.ndarray  # (n,)
    first: np.ndarray  # (n,) index of the first triangle in the tree's order

    @property
    def node(self) -> np.ndarray:
        """Node (k,) of each triangle."""
        return np.repeat(np.arange(len(self.count)), self.count)


def build_tree(vertices: np.ndarray, faces: np.ndarray) -> Tree:
    """Build the tree of triangles `faces` (f, 3) of `vertices` (v, 3), with boxes that bound them in float32; f > 0."""
    if not 0 < len(faces) < _MAX_TRIANGLES:
        raise ValueError(f"{len(faces)} triangles, a tree holds 1 to {_MAX_TRIANGLES - 1}")
    level = _root(np.asarray(vertices, np.float32), np.asarray(faces))
    if len(faces) <= LEAF:
        return _single_leaf(level)
    order = np.empty(len(faces), np.int32)
    boxes, children, numbered = [], [], 1
    depth = 0
    while len(level.count):
        level = _cut(level, depth)
        depth += 1
        boxes.append(_boxes(level).reshape(-1, 4, 3))
        leaf = level.count <= LEAF
        codes = _code(level.first, level.count)
        codes[~leaf] = numbered + np.arange(np.count_nonzero(~leaf))
        numbered += int(np.count_nonzero(~leaf))
        children.append(codes.reshape(-1, 2).astype(np.int32))
        level = _remove_leaves(level, leaf, order)
    return Tree(np.concatenate(boxes), np.concatenate(children), order)


def _root(vertices: np.ndarray, faces: np.ndarray) -> _Level:
    columns = [[vertices[:, axis].take(faces[:, corner]) for corner in range(3)] for axis in range(3)]
    low = [np.minimum(np.minimum(a, b), c) for a, b, c in columns]
    high = [np.maximum(np.maximum(a, b), c) for a, b, c in columns]
    zero = np.zeros(1, np.int64)
    return _Level(low, high, np.arange(len(faces)), zero, zero + len(faces), zero)


def _single_leaf(level: _Level) -> Tree:
    """Return the tree of a scene that fits into a leaf: its second child is empty."""
    box = _boxes(level)[0]
    children = _code(np.zeros(2, np.int64), np.array([level.count[0], 0])).astype(np.int32)
    return Tree(np.concatenate([box, box])[None], children[None], np.arange(level.count[0], dtype=np.int32))


def _boxes(level: _Level) -> np.ndarray:
    """Return the low and high corner (n, 2, 3) around the triangles of each node."""
    low = [np.minimum.reduceat(values, level.start) for values in level.low]
    high = [np.maximum.reduceat(values, level.start) for values in level.high]
    return np.stack([np.stack(low, axis=1), np.stack(high, axis=1)], axis=1)


def _cut(level: _Level, depth: int) -> _Level:
    """Return the two children of every node, adjacent to each other."""
    node = level.node
    second = _in_second_child(level, node, depth)
    before = np.cumsum(~second) - ~second  # triangles of first children before each triangle
    before -= before[level.start][node]
    in_first = np.add.reduceat(~second, level.start, dtype=np.int64)
    within = np.arange(len(node)) - level.start[node]
    index = level.start[node] + np.where(second, in_first[node] + within - before, before)
    count = np.stack([in_first, level.count - in_first], axis=1)

    def moved(values: np.ndarray) -> np.ndarray:
        out = np.empty_like(values)
        out[index] = values
        return out

    def starts(of_node: np.ndarray) -> np.ndarray:
        return np.stack([of_node, of_node + in_first], axis=1).ravel()

    return _Level(
        [moved(values) for values in level.low],
        [moved(values) for values in level.high],
        moved(level.triangle),
        starts(level.start),
        count.ravel(),
        starts(level.first),
    )


def _in_second_child(level: _Level, node: np.ndarray, depth: int) -> np.ndarray:
    """Return a mask (k,) of the triangles of the second child.

    A node is cut across the axis with the largest spread of its triangles' centres, where the sum of the children's
    areas times their numbers of triangles is minimal. If all centres coincide, or if the tree would become too deep,
    the triangles are halved in their current order.
    """
    centre, spread = _along_widest(level, node)
    bins = _BINS if len(node) > 2 * _BINS * len(level.count) else _FEW_BINS
    with np.errstate(divide="ignore", over="ignore"):
        scale = np.where(spread > 0, np.float32(bins * (1 - 1e-6)) / spread, np.float32(0))
    scale[~np.isfinite(scale)] = 0  # spreads that are too small for a quotient
    bin_of_triangle = np.minimum((centre * scale[node]).astype(np.int64), bins - 1)
    cut = _best_cut(level, node * bins + bin_of_triangle, bins)
    second = bin_of_triangle > cut[node]
    halved = (cut < 0) | (level.count > LEAF * 2.0 ** (LEVELS - 2 - depth))
    if halved.any():
        within = np.arange(len(node)) - level.start[node]
        second = np.where(halved[node], within >= (level.count // 2)[node], second)
    return second


def _along_widest(level: _Level, node: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return centres (k,) along the axis of their node's largest spread, from its minimum, and the spread (n,)."""
    centres = [low / 2 + high / 2 for low, high in zip(level.low, level.high, strict=True)]
    lowest = np.stack([np.minimum.reduceat(values, level.start) for values in centres])
    spreads = np.stack([np.maximum.reduceat(values, level.start) for values in centres]) - lowest
    axis = spreads.argmax(axis=0)
    chosen = np.choose(axis[node].astype(np.intp), centres)
    each = np.arange(len(axis))
    return chosen - lowest[axis, each][node], spreads[axis, each]


def _best_cut(level: _Level, key: np.ndarray, bins: int) -> np.ndarray:
    """Return the last bin (n,) of the first child; -1 if a child would be empty. `key`: (k,) node * bins + bin."""
    shape = (len(level.count), bins)
    count = np.bincount(key, minlength=shape[0] * bins).reshape(shape)
    low, high = [], []
    for axis in range(3):
        lowest, highest = (np.full(count.size, end, np.float32) for end in (np.inf, -np.inf))
        np.minimum.at(lowest, key, level.low[axis])
        np.maximum.at(highest, key, level.high[axis])
        low.append(lowest.reshape(shape))
        high.append(highest.reshape(shape))
    before = np.cumsum(count, axis=1)[:, :-1]
    after = level.count[:, None] - before
    from_the_end = _areas(*([values[:, ::-1] for values in part] for part in (low, high)))
    cost = before * _areas(low, high)[:, :-1] + after * from_the_end[:, -2::-1]
    cost[(before == 0) | (after == 0)] = np.inf
    best = cost.argmin(axis=1)
    return np.where(np.isfinite(cost[np.arange(len(best)), best]), best, -1)


def _areas(low: list[np.ndarray], high: list[np.ndarray]) -> np.ndarray:
    """Return half the area (n, bins) of the box around the bins up to each bin."""
    with np.errstate(invalid="ignore", over="ignore"):  # infinite sides before the first filled bin
        x, y, z = (
            np.maximum.accumulate(h, axis=1) - np.minimum.accumulate(v, axis=1) for v, h in zip(low, high, strict=True)
        )
        area = x * y + y * z + z * x
    return np.where(np.isfinite(area), area.astype(float), 0.0)


def _remove_leaves(level: _Level, leaf: np.ndarray, order: np.ndarray) -> _Level:
    """Return the level without its leaves, and write their triangles to the tree's order."""
    node = level.node
    done = leaf[node]
    index = level.first[node] + np.arange(len(node)) - level.start[node]
    order[index[done]] = level.triangle[done]
    count = level.count[~leaf]
    return _Level(
        [values[~done] for values in level.low],
        [values[~done] for values in level.high],
        level.triangle[~done],
        np.cumsum(count) - count,
        count,
        level.first[~leaf],
    )

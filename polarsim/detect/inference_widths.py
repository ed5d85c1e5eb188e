"""Detection at several widths of a picture: small rocks are found in wide pictures, large rocks in narrow ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from polarsim.detect import metrics
from polarsim.detect.nms import suppress_by_class
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.photo import BOX_CLASSES

_OVERLAP = 1.25  # boxes up to this factor beyond a gate are taken from both widths; suppression leaves one of them
_GATES_PX = (32.0, 48.0, 64.0, 96.0, 128.0)  # that are tried between two widths


@dataclass(frozen=True)
class Sizes:
    """Widths at which a detector looks at a picture, ascending, and the sizes of boxes where one gives way to the next.

    Of boxes with a longer side below `gates_px[n]` the wider picture `widths[n + 1]` is asked, of larger ones
    `widths[n]`; in pixels of a photo 1936 px wide. There is one gate fewer than widths.
    """

    widths: tuple[int, ...]
    gates_px: tuple[float, ...] = ()

    def scaled(self, factor: float) -> Sizes:
        """The same with gates in pixels of a picture that has `factor` times the width of a photo."""
        return Sizes(self.widths, tuple(factor * gate for gate in self.gates_px))

    def within(self, widest: int) -> Sizes:
        """The same with `widest` in place of all wider ones: no more can be seen of a picture than it has."""
        fewer = sum(width < widest for width in self.widths)
        widths = (*self.widths[:fewer], widest) if fewer < len(self.widths) else self.widths
        return Sizes(widths, self.gates_px[: len(widths) - 1])

    def ranges_px(self) -> list[tuple[float, float]]:
        """Least and largest longer side of the boxes that are taken at each width."""
        edges = [np.inf, *self.gates_px, 0.0]
        return [(low / _OVERLAP, high * _OVERLAP) for high, low in pairwise(edges)]


@dataclass(frozen=True)
class ClassSizes:
    """Sizes of each class, in the order of `BOX_CLASSES`: rocks may be looked for in wider pictures than shadows."""

    by_class: tuple[Sizes, ...]

    @classmethod
    def same(cls, sizes: Sizes) -> ClassSizes:
        """The same sizes for all classes."""
        return cls((sizes,) * len(BOX_CLASSES))

    @classmethod
    def named(cls, options: PredictionOptions) -> ClassSizes | None:
        """The sizes that the options name for all classes, or None where they name no widths."""
        return cls.same(Sizes(options.widths, options.gates_px)) if options.widths else None

    @property
    def widths(self) -> list[int]:
        """All widths at which a picture is looked at, ascending."""
        return sorted({width for own in self.by_class for width in own.widths})

    def scaled(self, factor: float) -> ClassSizes:
        """See `Sizes.scaled`."""
        return ClassSizes(tuple(own.scaled(factor) for own in self.by_class))

    def within(self, widest: int) -> ClassSizes:
        """See `Sizes.within`."""
        return ClassSizes(tuple(own.within(widest) for own in self.by_class))


def merge(found: Mapping[int, np.ndarray], sizes: ClassSizes, nms_iou: float, most: int) -> np.ndarray:
    """What is found of one picture at each of `sizes.widths`, as one list of boxes.

    Parameters
    ----------
    found : mapping of width to (n, 6)
        x0, y0, x1, y1 in pixels of a photo 1936 px wide, confidence, class.
    nms_iou
        IoU above which the less confident of two boxes of a class is dropped.
    most
        Boxes that are kept, the most confident ones.

    Returns
    -------
    (m, 6), the most confident first
    """
    if len(sizes.widths) == 1:
        return found[sizes.widths[0]]
    taken = []
    for kind, own in enumerate(sizes.by_class):
        for width, (least, largest) in zip(own.widths, own.ranges_px(), strict=True):
            rows = found[width]
            side = (rows[:, 2:4] - rows[:, :2]).max(axis=1, initial=0)
            taken.append(rows[(rows[:, 5] == kind) & (side >= least) & (side < largest)])
    return suppress_by_class(np.concatenate(taken), nms_iou, most)


def choose_sizes(
    labels: Sequence[tuple[np.ndarray, np.ndarray]],
    found: Mapping[int, Sequence[np.ndarray]],
    nms_iou: float,
    most: int,
) -> ClassSizes:
    """The widths and gates with the largest AP@0.5 of each class.

    One width alone, and two with each of a few gates between them. The pictures should be of places that the detector
    was not trained on, and none of those that it will be evaluated on. A class without labels has the sizes of all.

    Parameters
    ----------
    labels : sequence of (classes (n,), boxes (n, 4))
        Of every picture, pixels of a photo.
    found : mapping of width to sequence of (n, 6)
        What was found of every picture at each width, as in `merge`.

    Raises
    ------
    DetectError
        No picture has a label.
    """
    if not any(len(classes) for classes, _ in labels):
        raise DetectError("no labels to choose the sizes of pictures by")
    widths = sorted(found)
    tried = [Sizes((width,)) for width in widths]
    tried += [Sizes(pair, (gate,)) for pair in combinations(widths, 2) for gate in _GATES_PX]

    def precisions(sizes: Sizes) -> np.ndarray:
        """(classes,) AP@0.5; NaN of a class without labels."""
        of_pictures = (
            dict(zip(sizes.widths, rows, strict=True))
            for rows in zip(*(found[width] for width in sizes.widths), strict=True)
        )
        merged = [merge(by_width, ClassSizes.same(sizes), nms_iou, most) for by_width in of_pictures]
        ranked = metrics.rank_classes(labels, merged, np.array([0.5]))
        return np.array([metrics.precision_at_recalls(one).mean() for one in ranked])

    by_size = np.array([precisions(sizes) for sizes in tried])  # (tried, classes)
    labelled = ~np.isnan(by_size).any(axis=0)
    by_size[:, ~labelled] = by_size[:, labelled].mean(axis=1, keepdims=True)
    return ClassSizes(tuple(tried[best] for best in by_size.argmax(axis=0)))

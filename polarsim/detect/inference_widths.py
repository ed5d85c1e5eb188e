"""Detection at several inference widths: wide images for small rocks, narrow images for large rocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from polarsim.detect import metrics
from polarsim.detect.nms import suppress_by_class
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.photo import BOX_CLASSES, REFERENCE_WIDTH_PX
from polarsim.wording import enumerated

_OVERLAP = 1.25  # boxes within this factor of a gate are used from both widths before suppression
GATES_PX = (32.0, 48.0, 64.0, 96.0, 128.0)  # candidate gates between two widths


@dataclass(frozen=True)
class InferenceWidths:
    """Inference widths, ascending, and the box sizes (gates) at which detection switches between adjacent widths.

    Boxes with a longer side below `gates_px[n]` (px of an image `REFERENCE_WIDTH_PX` wide) are detected at
    `widths[n + 1]`, larger boxes at `widths[n]`. There is one gate between each two adjacent widths.
    """

    widths: tuple[int, ...]
    gates_px: tuple[float, ...] = ()

    def within(self, widest: int) -> InferenceWidths:
        """Return a copy with `widest` in place of all wider widths, since upscaling adds no detail."""
        fewer = sum(width < widest for width in self.widths)
        widths = (*self.widths[:fewer], widest) if fewer < len(self.widths) else self.widths
        return InferenceWidths(widths, self.gates_px[: len(widths) - 1])

    def ranges_px(self, width: int) -> list[tuple[float, float]]:
        """Return the minimum and maximum longer side of boxes at each width, px of an image of a `width`."""
        factor = width / REFERENCE_WIDTH_PX
        edges = [np.inf, *(factor * gate for gate in self.gates_px), 0.0]
        return [(low / _OVERLAP, high * _OVERLAP) for high, low in pairwise(edges)]


@dataclass(frozen=True)
class ClassInferenceWidths:
    """Inference widths of each class, in the order of `BOX_CLASSES`."""

    by_class: tuple[InferenceWidths, ...]

    @classmethod
    def same(cls, sizes: InferenceWidths) -> ClassInferenceWidths:
        """Return equal widths for all classes."""
        return cls((sizes,) * len(BOX_CLASSES))

    @classmethod
    def named(cls, options: PredictionOptions) -> ClassInferenceWidths | None:
        """Return the sizes of the options for all classes; None if the options have no widths."""
        return cls.same(InferenceWidths(options.widths, options.gates_px)) if options.widths else None

    @property
    def widths(self) -> list[int]:
        """All inference widths, ascending."""
        return sorted({width for sizes in self.by_class for width in sizes.widths})

    def within(self, widest: int) -> ClassInferenceWidths:
        """Return a copy, see `InferenceWidths.within`."""
        return ClassInferenceWidths(tuple(sizes.within(widest) for sizes in self.by_class))


def widths_text(by_class: Sequence[tuple[tuple[int, ...], tuple[float, ...]]]) -> str:
    """Return the widths and gates of each class as text."""
    texts = []
    for kind, (widths, gates) in zip(BOX_CLASSES, by_class, strict=True):
        limits = enumerated(f"{gate:g}" for gate in gates) if gates else ""
        below = f" (boxes below {limits} px of {REFERENCE_WIDTH_PX:,}: the next larger width)" if gates else ""
        texts.append(f"{kind}s {enumerated(widths)} px{below}")
    return "; ".join(texts)


def merge(found: Mapping[int, np.ndarray], sizes: ClassInferenceWidths, nms_iou: float, width: int) -> np.ndarray:
    """Merge the boxes (n, 6) of one image at each width.

    Boxes are x0, y0, x1, y1 in pixels of an image of a `width`, confidence, class; the result is in descending order of
    confidence.
    """
    if len(sizes.widths) == 1:
        return found[sizes.widths[0]]
    selected = []
    for kind, class_sizes in enumerate(sizes.by_class):
        for at, (smallest, largest) in zip(class_sizes.widths, class_sizes.ranges_px(width), strict=True):
            rows = found[at]
            side = (rows[:, 2:4] - rows[:, :2]).max(axis=1, initial=0)
            selected.append(rows[(rows[:, 5] == kind) & (side >= smallest) & (side < largest)])
    return suppress_by_class(np.concatenate(selected), nms_iou)


def choose_sizes(
    labels: Sequence[tuple[np.ndarray, np.ndarray]],
    found: Mapping[int, Sequence[np.ndarray]],
    nms_iou: float,
    width: int,
    gates_px: Sequence[float] = GATES_PX,
) -> ClassInferenceWidths:
    """Return the widths and gates with the maximum AP@0.5 of each class.

    Candidates are single widths and pairs of widths with gates of `gates_px`. The images should show places that are
    used neither for training nor for the evaluation. Classes without labels get the sizes with the best mean AP@0.5.

    Labels are classes (n,) and boxes (n, 4) of each image, pixels of a photo of a `width`; `found` are the boxes of
    each image at each inference width, as in `merge`.
    """
    if not any(len(classes) for classes, _ in labels):
        raise DetectError("inference widths cannot be chosen: no image has labels")
    widths = sorted(found)
    candidates = [InferenceWidths((single,)) for single in widths]
    candidates += [InferenceWidths(pair, (gate,)) for pair in combinations(widths, 2) for gate in gates_px]

    def precisions(sizes: InferenceWidths) -> np.ndarray:
        """Return AP@0.5 (classes,); NaN for classes without labels."""
        of_pictures = (
            dict(zip(sizes.widths, rows, strict=True))
            for rows in zip(*(found[width] for width in sizes.widths), strict=True)
        )
        merged = [merge(by_width, ClassInferenceWidths.same(sizes), nms_iou, width) for by_width in of_pictures]
        ranked = metrics.rank_classes(labels, merged, np.array([0.5]))
        return np.array([metrics.precision_at_recalls(of_class).mean() for of_class in ranked])

    by_size = np.array([precisions(sizes) for sizes in candidates])  # (tried, classes)
    labelled = ~np.isnan(by_size).any(axis=0)
    by_size[:, ~labelled] = by_size[:, labelled].mean(axis=1, keepdims=True)
    return ClassInferenceWidths(tuple(candidates[best] for best in by_size.argmax(axis=0)))

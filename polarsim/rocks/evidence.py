"""Seed boxes as evidence: positions that confirm a rock, fit of rocks and boxes, and boxes that no rock explains."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from polarsim.geometry.boxes import iou, largest_iou
from polarsim.geometry.consensus import consensus_boxes, warn_mislabelled_positions
from polarsim.run_files.rigs import LocalisedRig

# Minimum share of at least as many seed boxes that match a rock. On the analog, at least 0.96 with own boxes and
# 0.02 on terrain 1 with those of terrain 3.
MIN_EXPLAINED, MIN_BOXES = 0.5, 5
ANNOTATION_IOU = 0.05  # IoU per position: smaller differences between two explanations are within the annotation error

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Evidence:
    """Annotated boxes in the left photos of a terrain's positions."""

    localised: Mapping[str, LocalisedRig]
    annotated: Mapping[str, Sequence[np.ndarray]]  # position -> rock boxes (n, 4) in pixels, one array per seed file
    min_iou: float  # minimum IoU of a rock's box and a matching annotation

    @cached_property
    def agreed(self) -> dict[str, np.ndarray]:
        """Return consensus boxes (n, 4), one per rock, by position with boxes."""
        boxes = {position: consensus_boxes(annotated) for position, annotated in sorted(self.annotated.items())}
        return {
            position: consensus
            for position, consensus in boxes.items()
            if position in self.localised and len(consensus)
        }

    def without_mislabelled(self, rocks: Sequence[np.ndarray]) -> Evidence:
        """Exclude positions with boxes of another position, by rocks (n, 3) from shape only; log a warning."""
        cameras = {position: rig.camera("L") for position, rig in self.localised.items() if not rig.unproven}
        names = warn_mislabelled_positions(self.agreed, cameras, rocks)
        return replace(
            self, annotated={position: boxes for position, boxes in self.annotated.items() if position not in names}
        )

    def confirming_positions(self, points: np.ndarray) -> list[str]:
        """Return positions with a seed box that matches a rock, by its points (n, 3) in the sandbox, metres."""
        return [
            position
            for position, annotated in sorted(self.annotated.items())
            if position in self.localised
            and len(annotated)
            and self.fit(position, points, np.concatenate(annotated)) >= self.min_iou
        ]

    def boxes(self, parts: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """Return boxes (p, 4) around parts, given by points (n, 3), in every photo with agreed boxes; NaN outside."""
        cameras = {position: self.localised[position].camera("L") for position in self.agreed}
        return {
            position: np.array([camera.box_around(points) for points in parts]).reshape(-1, 4)
            for position, camera in cameras.items()
        }

    def fit(self, position: str, points: np.ndarray, boxes: np.ndarray) -> float:
        """Return the maximum IoU of the box around points (n, 3) with boxes (m, 4) of a position; 0 without a point."""
        box = self._box(position, points)
        return 0.0 if box is None else float(iou(box[None], boxes).max(initial=0))

    def unexplained(self, rocks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """Return the agreed boxes (n, 4) by position that match none of the rocks, given by points (n, 3)."""
        unmatched = {}
        for position, annotated in self.agreed.items():
            boxes = [box for box in (self._box(position, points) for points in rocks) if box is not None]
            unmatched[position] = annotated[largest_iou(annotated, np.array(boxes)) < self.min_iou]
        return unmatched

    def warn_of_other_terrain(self, name: str, rocks: Sequence[np.ndarray]) -> None:
        """Log a warning if most seed boxes match none of the rocks, given by points (n, 3), of the terrain `name`."""
        boxes, unmatched = (sum(map(len, parts.values())) for parts in (self.agreed, self.unexplained(rocks)))
        if boxes >= MIN_BOXES and boxes - unmatched < MIN_EXPLAINED * boxes:
            log.warning("%s: %d of %d seed boxes match no rock, check that seeds, photos and scans show the same "
                        "terrain", name, unmatched, boxes)  # fmt: skip

    def _box(self, position: str, points: np.ndarray) -> np.ndarray | None:
        """Return the box (4,) around the visible points in a position's left photo; None without a visible point."""
        box = self.localised[position].camera("L").box_around(points)
        return None if np.isnan(box).any() else box

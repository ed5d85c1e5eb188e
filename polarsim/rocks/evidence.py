"""Seed boxes as evidence: which positions' labels show a rock, how well it fits them, which boxes no rock explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from polarsim.geometry.boxes import iou
from polarsim.geometry.consensus import consensus_boxes, positions_of_strangers
from polarsim.run_files.rigs import LocalisedRig

PEN_IOU = 0.05  # of IoU a position: smaller differences between two explanations of a box are the pen's


@dataclass(frozen=True)
class Evidence:
    """What people drew in the left photos of a terrain's positions."""

    localised: Mapping[str, LocalisedRig]
    annotated: Mapping[str, Sequence[np.ndarray]]  # position -> rock boxes (n, 4) in pixels, one array a seed file
    min_iou: float  # of an annotated box and a rock's own that belong together

    @cached_property
    def agreed(self) -> dict[str, np.ndarray]:
        """(n, 4) one box a rock by position, where there are any."""
        boxes = {position: consensus_boxes(annotated) for position, annotated in sorted(self.annotated.items())}
        return {position: found for position, found in boxes.items() if position in self.localised and len(found)}

    def of_their_position(self, rocks: Sequence[np.ndarray]) -> Evidence:
        """The same without positions whose boxes are another one's, by rocks (n, 3) that shape alone tells; warns."""
        cameras = {position: rig.camera("L") for position, rig in self.localised.items() if not rig.unproven}
        names = positions_of_strangers(self.agreed, cameras, rocks)
        return replace(
            self, annotated={position: boxes for position, boxes in self.annotated.items() if position not in names}
        )

    def confirming(self, points: np.ndarray) -> list[str]:
        """Positions of which some seed shows a rock, by its points (n, 3) in the sandbox, metres."""
        found = []
        for position, annotated in sorted(self.annotated.items()):
            if position not in self.localised or not len(annotated):
                continue
            box = self._box(position, points)
            if box is not None and iou(box[None], np.concatenate(annotated)).max(initial=0) >= self.min_iou:
                found.append(position)
        return found

    def boxes(self, parts: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """(p, 4) around parts, given by points (n, 3), in every photo with agreed boxes; NaN where it shows none."""
        cameras = {position: self.localised[position].camera("L") for position in self.agreed}
        return {
            position: np.array([camera.box_around(points) for points in parts]).reshape(-1, 4)
            for position, camera in cameras.items()
        }

    def fit(self, position: str, points: np.ndarray, boxes: np.ndarray) -> float:
        """Largest IoU of the box around points (n, 3) with boxes (m, 4) of a position; 0 where no point is seen."""
        box = self._box(position, points)
        return 0.0 if box is None else float(iou(box[None], boxes).max(initial=0))

    def unexplained(self, rocks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """(n, 4) agreed boxes by position on which none of the rocks, given by points (n, 3), lies."""
        left = {}
        for position, annotated in self.agreed.items():
            boxes = [box for box in (self._box(position, points) for points in rocks) if box is not None]
            overlap = iou(annotated, np.array(boxes).reshape(-1, 4)).max(axis=1, initial=0)
            left[position] = annotated[overlap < self.min_iou]
        return left

    def _box(self, position: str, points: np.ndarray) -> np.ndarray | None:
        """(4,) around points in a position's left photo, as far as the photo shows them; None where it shows none."""
        box = self.localised[position].camera("L").box_around(points)
        return None if np.isnan(box).any() else box

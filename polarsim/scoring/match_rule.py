"""How projected meshes and drawn boxes are compared in scores and figures: as the cameras stage compares them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MatchRule:
    """Trimming of meshes, and what makes boxes one rock's."""

    trim: float  # metres above a rock's rim from which its sides count
    trim_share: float  # ... but from this share of its height on in any case
    consensus_share: float  # of the photo sets that must show a box
    same_iou: float  # boxes of two photos that overlap by more are one rock's
    gate_px: float  # between centres of a pair

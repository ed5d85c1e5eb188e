"""How people box shadows: not where geometry ends, but a little beyond the tip, and a little into the rock.

An edge of a cast shadow's box is moved outwards by a linear rule. Its terms count by where the edge lies as seen along
the shadow in the photo: at its `far` end, at its `near` end beside the rock, or along its `side`. The coefficients were
fitted by `benchmarks/transfers.py --fit` to the shadow boxes of terrains 01, 03, 04, 08, 11 of the published labels
(robust regression); it also prints what coefficients fitted to four of these terrains do on the fifth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

OUTWARD = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # normals of the left, top, right, bottom edge
TERMS = (
    "far m", "near m", "side m", "down m",  # metres at the rock
    "far of shadow", "side of shadow",  # of the shadow's extent across the edge
    "near of rock", "near gap",  # of the rock's extent; of how far the edge lies outside the rock's own
    "near label", "side label",  # of how far the rock's label reaches beyond its projected mesh there
)  # fmt: skip
COEFFICIENTS = (0.0245, -0.0062, 0.0100, 0.0071, -0.1419, -0.0401, -0.2836, -0.4524, 0.1407, 0.6529)


def as_people_draw(
    box: np.ndarray,
    rock_label: np.ndarray,
    rock_mesh: np.ndarray,
    px_per_m: float,
    coefficients: Sequence[float] = COEFFICIENTS,
) -> np.ndarray:
    """The box (4,) that a person draws around a shadow whose visible part geometry puts into `box` (4,), px.

    Parameters
    ----------
    rock_label, rock_mesh : (4,) float
        Box of the shadow's rock as labelled, and as its mesh projects; px.
    px_per_m
        Scale of the photo at the rock.
    coefficients
        One a term.
    """
    return np.asarray(
        box + OUTWARD.sum(axis=1) * (terms(box, rock_label, rock_mesh, px_per_m) @ np.asarray(coefficients))
    )


def terms(box: np.ndarray, rock_label: np.ndarray, rock_mesh: np.ndarray, px_per_m: float) -> np.ndarray:
    """(4, len(TERMS)) what the edges' moves are linear in, px."""
    away = (box[:2] + box[2:] - rock_label[:2] - rock_label[2:]) / 2
    along = OUTWARD @ (away / max(float(np.linalg.norm(away)), 1.0))
    far, near = np.clip(along, 0, None), np.clip(-along, 0, None)
    side = 1 - np.abs(along)
    outward = OUTWARD.sum(axis=1)
    shadow_extent, rock_extent = np.tile(box[2:] - box[:2], 2), np.tile(rock_label[2:] - rock_label[:2], 2)
    gap, label = outward * (box - rock_label), outward * (rock_label - rock_mesh)
    metres = [far * px_per_m, near * px_per_m, side * px_per_m, OUTWARD[:, 1] * px_per_m]
    shares = [far * shadow_extent, side * shadow_extent, near * rock_extent, near * gap, near * label, side * label]
    return np.stack([*metres, *shares], axis=1)

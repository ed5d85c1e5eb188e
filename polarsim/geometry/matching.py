"""Projected boxes paired with annotated ones."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from polarsim.geometry import boxes as box_geometry

FORBIDDEN = 1e3
MATCH_GATE_PX = 40.0  # largest distance of a pair, centre to centre: poses err by less
MAX_LOG_SIZE = 1.6  # |log width ratio| + |log height ratio| of a pair


def assign(
    projected: np.ndarray, annotated: np.ndarray, gate_px: float = MATCH_GATE_PX
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (rows, columns) of projected (m, 4) and annotated (b, 4) boxes that are near each other and alike in
    size.
    """
    if not len(projected) or not len(annotated):
        return np.zeros(0, int), np.zeros(0, int)
    size = np.maximum(projected[:, 2:] - projected[:, :2], 1e-3)
    size_annotated = annotated[:, 2:] - annotated[:, :2]
    offset = (projected[:, None, :2] + projected[:, None, 2:] - annotated[None, :, :2] - annotated[None, :, 2:]) / 2
    distance = np.linalg.norm(offset, axis=-1)
    log_size = np.abs(np.log(size[:, None] / size_annotated[None])).sum(axis=-1)
    cost = distance / gate_px + 0.5 * log_size - 0.5 * box_geometry.iou(np.nan_to_num(projected), annotated)
    allowed = (distance <= gate_px) & (log_size <= MAX_LOG_SIZE)  # NaN is not allowed either
    rows, columns = linear_sum_assignment(np.where(allowed, cost, FORBIDDEN))
    good = allowed[rows, columns]
    return rows[good], columns[good]

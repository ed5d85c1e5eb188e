"""Weights of the edges of annotated boxes and of projected meshes in the mean of both."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.boxes import area

CAUCHY = 2.385  # standard deviations at which the weight of an edge is 0.5 (95 % efficiency for Gaussian errors)
# Standard deviation of an edge of one annotated box, by sqrt(area): 2.7 px at 20 px to 6.3 px at 150 px, measured as
# the robust spread of 3,324 published boxes around the boxes of the same rocks at other azimuths.
EDGE_PX, EDGE_SHARE = 2.2, 0.027


def edge_sd_px(boxes: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """Return the standard deviation (n, 1) of the edges of annotated boxes (n, 4) in photos of a `photo_scale`."""
    return np.asarray(EDGE_PX * scale + EDGE_SHARE * np.sqrt(area(boxes)))[:, None]


def mesh_weights(
    annotated: np.ndarray, count: np.ndarray, mesh: np.ndarray, weight: float, scale: float = 1.0
) -> np.ndarray:
    """Return the weights (n, 4) of the edges of projected boxes `mesh` (n, 4) relative to one annotation.

    A mesh edge has the weight of `weight` annotations, reduced by the Cauchy weight function (Holland and Welsch,
    Commun. Stat. A 6 (1977) 813) if it deviates from the annotations: scans miss parts of rocks and include sand.
    Edges without annotations have weight 1.

    `annotated`, `count` (n, 4): mean of the annotated edges, and number of annotations. `annotated` is ignored where
    `count` is 0. `scale`: `photo_scale` of the photo.
    """
    unannotated = count == 0
    reference = np.where(unannotated, mesh, annotated)
    off = (mesh - reference) / (CAUCHY * edge_sd_px(reference, scale))
    # The variance of mesh minus mean is (1 / count + 1 / weight) times the variance of one annotation.
    share = np.divide(count * weight, count + weight, out=np.zeros_like(reference), where=~unannotated)
    return np.where(unannotated, 1.0, weight / (1 + off**2 * share))

"""How well each vertex of a mesh is supported by what scanners saw: what was filled in must not pass for measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

FILE = "support.parquet"
NEAR, FAR = 1.5, 5.0  # spacings to the next scanned point: full support up to the first, none from the second on


class Scanned(NamedTuple):
    """Scanned points (n, 3) of one surface, metres, and how far apart they lie where nothing is missing."""

    points: np.ndarray
    spacing: float


def support(vertices: np.ndarray, scanned: Scanned) -> np.ndarray:
    """(v,) 1 where a scanned point lies beside a vertex (v, 3), falling to 0 at `FAR` spacings."""
    if not len(scanned.points):
        return np.zeros(len(vertices))
    reach = FAR * scanned.spacing
    distance = np.asarray(KDTree(scanned.points).query(vertices, distance_upper_bound=reach)[0])
    return np.clip((FAR - np.minimum(distance, reach) / scanned.spacing) / (FAR - NEAR), 0.0, 1.0)


def support_table(support_of_mesh: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """A row a vertex: the mesh's file name, the vertex's number from 0, its support to a hundredth."""
    names = pd.Categorical(np.repeat(list(support_of_mesh), [len(values) for values in support_of_mesh.values()]))
    vertices = [np.arange(len(values), dtype=np.int32) for values in support_of_mesh.values()]
    values = np.concatenate(list(support_of_mesh.values()))
    return pd.DataFrame(
        {"mesh": names, "vertex": np.concatenate(vertices), "support": np.round(values, 2).astype(np.float32)}
    )

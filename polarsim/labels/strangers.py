"""Seeds that lie under another position's name are left out, by the rocks' meshes and all poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.formats.rigs import PlacedRig
from polarsim.formats.scene import TerrainMesh
from polarsim.geometry.consensus import consensus_boxes, positions_of_strangers
from polarsim.labels.seeds import Drawings


def without_strangers(drawings: Drawings, terrain: TerrainMesh, placed: Mapping[str, PlacedRig]) -> Drawings:
    """The drawings of positions whose left photos' rocks the meshes meet; a warning names the others.

    Poses of the survey tell nothing, and neither do they of their own position's drawings.
    """
    annotated: dict[str, list[np.ndarray]] = {}
    for key, one in drawings.items():
        if key.camera == "L":
            annotated.setdefault(key.position, []).append(one.rocks)
    agreed = {position: consensus_boxes(own) for position, own in annotated.items()}
    cameras = {position: rig.camera("L") for position, rig in placed.items() if not rig.surveyed}
    names = positions_of_strangers(agreed, cameras, [terrain.rock_vertices(rock) for rock in terrain.rocks])
    return {key: one for key, one in drawings.items() if key.position not in names}

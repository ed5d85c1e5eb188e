"""Seeds that lie under another position's name are left out, by the rocks' meshes and all poses."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np

from polarsim.formats.rigs import PlacedRig
from polarsim.formats.scene import TerrainMesh
from polarsim.geometry.boxes import around, clip
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.strangers import find_strangers
from polarsim.labels.seeds import Drawings

log = logging.getLogger("polarsim")


def without_strangers(drawings: Drawings, terrain: TerrainMesh, placed: Mapping[str, PlacedRig]) -> Drawings:
    """The drawings of positions whose left photos' rocks the meshes meet; a warning names the others.

    Poses of the survey tell nothing, and neither do they of their own position's drawings.
    """
    vertices = [terrain.rock_vertices(rock) for rock in terrain.rocks]
    projected = {
        position: np.array(
            [clip(around(rig.project("L", own)), rig.rig.left.width, rig.rig.left.height) for own in vertices]
        ).reshape(-1, 4)
        for position, rig in placed.items()
        if not rig.surveyed
    }
    drawn: dict[str, list[np.ndarray]] = {}
    for key, one in drawings.items():
        if key.camera == "L":
            drawn.setdefault(key.position, []).append(one.rocks)
    strangers = find_strangers({position: consensus_boxes(own) for position, own in drawn.items()}, projected)
    for stranger in strangers:
        log.warning("%s", stranger)
    names = {stranger.position for stranger in strangers}
    return {key: one for key, one in drawings.items() if key.position not in names}

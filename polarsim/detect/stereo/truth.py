"""Reference depth and rock of each pixel of the rectified left camera, computed from the meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.rays import Caster
from polarsim.photo import NO_ROCK
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh


@dataclass(frozen=True)
class DepthTruth:
    """Reference values of each pixel of the rectified left image."""

    depth: np.ndarray  # (h, w) metres along z, NaN outside the meshes
    rock: np.ndarray  # (h, w) rock id or NO_ROCK
    shared: np.ndarray  # (h, w) bool: the point is visible in the right camera


def depth_truth(mesh: TerrainMesh, caster: Caster, localised: LocalisedRig, rig: Rectification) -> DepthTruth:
    """Cast a ray through each pixel, and a ray from each hit to the right camera."""
    sandbox_from_rectified = localised.sandbox_from_left @ rig.left_from_rectified
    shape = rig.lens.shape
    directions = sandbox_from_rectified.rotate(rig.lens.pixel_directions().reshape(-1, 3))
    origins = np.broadcast_to(sandbox_from_rectified.translation, directions.shape)
    depth, face = caster.nearest(origins, directions)  # in units of directions, whose z is 1
    hit = np.flatnonzero(np.isfinite(depth))
    points = origins[hit] + depth[hit, None] * directions[hit]
    shared = np.zeros(len(depth), bool)
    pixels = localised.project("R", points)
    size = np.array([localised.rig.right.width, localised.rig.right.height])
    inside = (pixels >= 0).all(axis=1) & (pixels < size).all(axis=1)  # False for NaN, behind the camera
    back = localised.sandbox_from("R").translation - points
    shared[hit] = inside & ~caster.occluded(points, back, 1.0)
    rock = np.full(len(depth), NO_ROCK)
    rock[hit] = mesh.rock_of_face[face[hit]]
    depth = np.where(np.isfinite(depth), depth, np.nan)
    return DepthTruth(depth.reshape(shape), rock.reshape(shape), shared.reshape(shape))

"""Range maps of made-up scenes, by ray casts."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from polarsim.geometry.casters import make_caster
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster

REACH = 9.0  # metres


def caster_of(meshes: Iterable[Mesh]) -> Caster:
    """Return a caster of several meshes."""
    meshes = list(meshes)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return make_caster(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def range_map(
    scene: Caster, sandbox_from_camera: Pose, lens: Lens, rng: np.random.Generator, noise: float
) -> np.ndarray:
    """Return points (h, w, 3) in the camera frame, with `noise` along the rays, metres; NaN without a hit."""
    directions = lens.pixel_directions()
    rays = sandbox_from_camera.rotate(directions).reshape(-1, 3)
    depth = scene.nearest(np.broadcast_to(sandbox_from_camera.translation, rays.shape), rays)[0].reshape(lens.shape)
    reach = np.linalg.norm(directions, axis=-1)
    depth = np.where(depth * reach < REACH, depth + noise * rng.standard_normal(depth.shape) / reach, np.nan)
    return directions * depth[..., None]

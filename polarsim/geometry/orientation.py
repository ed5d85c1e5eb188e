"""Outer sides of the faces of open meshes, by the visible sky."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import spread_directions
from polarsim.geometry.rays import Caster
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.geometry.vectors import cross, normalise

_SKY_RAYS = 60  # number of directions of the upper hemisphere in which the sky is searched
_OFF_M = 1e-4  # distance of the rays' origins from the face


def outward_signs(centres: np.ndarray, normals: np.ndarray, caster: Caster) -> np.ndarray:
    """Return (f,) 1 where normals (f, 3) of faces are outward and -1 elsewhere, by the side that sees more of the sky.

    A side sees the part of the upper hemisphere that `caster`, the mesh of the faces, does not hide from `centres`
    (f, 3), m. Where both sides see equal parts, the normal counts as outward. Method: Takayama et al., A Simple Method
    for Correcting Facet Orientations in Polygon Meshes Based on Ray Casting (JCGT 2014), for meshes with holes, the
    faces of which have no common orientation.
    """
    sky = spread_directions(2 * _SKY_RAYS)[:_SKY_RAYS]
    visible = []
    for side in (1, -1):
        origins = np.repeat(centres + side * _OFF_M * normals, len(sky), axis=0)
        directions = np.tile(sky, (len(centres), 1))
        above = np.einsum("nk,nk->n", np.repeat(side * normals, len(sky), axis=0), directions) > 0
        above[above] = np.isinf(caster.nearest(origins[above], directions[above])[0])
        visible.append(above.reshape(-1, len(sky)).sum(axis=1))
    return np.where(visible[0] >= visible[1], 1.0, -1.0)


def oriented(mesh: Mesh) -> Mesh:
    """Return a mesh with counter-clockwise faces seen from the outer side, see `outward_signs`."""
    corners = mesh.vertices[mesh.faces]
    normals = normalise(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    inward = outward_signs(corners.mean(axis=1), normals, EmbreeCaster(mesh.vertices, mesh.faces)) < 0
    return Mesh(mesh.vertices, np.where(inward[:, None], mesh.faces[:, ::-1], mesh.faces))

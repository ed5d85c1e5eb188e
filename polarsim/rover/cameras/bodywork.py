"""Mesh of the rover's body: boxes and cylinders that cast its shadow and appear in images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.poses import Pose
from polarsim.render.surfaces import box_mesh
from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import ShapePart, Vehicle, WheelPart

_SIDES = 48  # number of sides of a cylinder
_METAL = 0.4  # albedo of grousers on wheels without a rim shape
_ROOT = 0.5  # share of a grouser's height that is inside the rim, so that no light passes below it
MeshArrays = tuple[np.ndarray, np.ndarray, np.ndarray]  # vertices (v, 3), faces (f, 3), unit normals (v, 3)


@dataclass(frozen=True)
class Solid:
    """Triangles fixed to a link: vertices (v, 3) in the link's frame, metres, faces (f, 3), normals (v, 3)."""

    link: str
    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


def body_of(vehicle: Vehicle) -> Bodywork:
    """Return the shapes and the grousers of a vehicle's table."""
    solids = [_shape(shape) for shape in vehicle.shapes]
    treads = [grousers(f"{wheel.code}_wheel", wheel) for wheel in vehicle.wheels if wheel.grousers]
    rims = {shape.link: shape.albedo for shape in vehicle.shapes}
    return Bodywork(
        (*solids, *treads),
        (*(shape.albedo for shape in vehicle.shapes), *(rims.get(tread.link, _METAL) for tread in treads)),
    )


def grousers(link: str, wheel: WheelPart) -> Solid:
    """Return straight bars across a wheel's rim, arranged about the link's y axis."""
    half = wheel.grouser_thickness_m / 2, wheel.width_m / 2
    foot, crest = wheel.radius_m - _ROOT * wheel.grouser_height_m, wheel.outer_radius_m
    bar = box_mesh(np.array([-half[0], -half[1], foot]), np.array([half[0], half[1], crest]))
    parts = []
    for number in range(wheel.grousers):
        rotation = Pose.from_rotvec(np.array([0, 2 * np.pi * number / wheel.grousers, 0]), np.zeros(3))
        parts.append((rotation.apply(bar[0]), bar[1], rotation.rotate(bar[2])))
    return Solid(link, *join_mesh_arrays(parts))


@dataclass(frozen=True)
class Bodywork:
    """All solids of a rover, joined into a single mesh."""

    solids: tuple[Solid, ...]
    albedo: tuple[float, ...]  # of each solid

    @cached_property
    def links(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(solid.link for solid in self.solids))

    @cached_property
    def faces(self) -> np.ndarray:
        """(f, 3) vertex indices; the motion of the rover does not change them."""
        return join_meshes([Mesh(solid.vertices, solid.faces) for solid in self.solids]).faces

    @cached_property
    def solid_of_face(self) -> np.ndarray:
        """(f,) index of the solid of each face."""
        return np.repeat(np.arange(len(self.solids)), [len(solid.faces) for solid in self.solids])

    def posed(self, world_from_link: Mapping[str, Pose]) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices and normals (v, 3) for given poses of the links."""
        vertices = [world_from_link[solid.link].apply(solid.vertices) for solid in self.solids]
        normals = [world_from_link[solid.link].rotate(solid.normals) for solid in self.solids]
        return np.concatenate(vertices), np.concatenate(normals)


def links_at(
    vehicle: Vehicle,
    world_from_base: Pose,
    world_from_wheel: Mapping[str, Pose],
    lift: Mapping[str, float],
    steer: Mapping[str, float],
) -> dict[str, Pose]:
    """Return the poses of all links.

    Arms slide along the rover's z axis and uprights rotate about it; the poses of wheels are arguments.
    """
    poses = {"base_link": world_from_base}
    for wheel in vehicle.wheels:
        code = wheel.code
        arm = world_from_base @ Pose(np.eye(3), np.add(wheel.position_m, (0, 0, lift[code])))
        poses[f"{code}_arm"] = arm
        poses[f"{code}_upright"] = arm @ Pose.from_rotvec(np.array([0, 0, steer[code]]), np.zeros(3))
        poses[f"{code}_wheel"] = world_from_wheel[code]
    return poses


def join_mesh_arrays(parts: Sequence[MeshArrays]) -> MeshArrays:
    """Return `join_meshes` of all parts, with the normals of the parts."""
    mesh = join_meshes([Mesh(vertices, faces) for vertices, faces, _ in parts])
    return mesh.vertices, mesh.faces, np.concatenate([normals for _, _, normals in parts])


def _shape(shape: ShapePart) -> Solid:
    """Return a box, or a closed cylinder along its y axis."""
    pose = link_from_part(shape.position_m, shape.yaw_deg, shape.pitch_deg, shape.roll_deg)
    if shape.kind == "box":
        half = np.array(shape.size_m) / 2
        vertices, faces, normals = box_mesh(-half, half)
    else:
        vertices, faces, normals = _cylinder(shape.size_m[0] / 2, shape.size_m[1], _SIDES)
    return Solid(shape.link, pose.apply(vertices), faces, pose.rotate(normals))


def _cylinder(radius: float, length: float, sides: int) -> MeshArrays:
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.sin(angle), np.zeros(sides), np.cos(angle)], axis=1)
    offset = np.array([0, length / 2, 0])
    around, onward = np.arange(sides), (np.arange(sides) + 1) % sides
    below, above = (
        np.stack([around, sides + around, onward], axis=1),
        np.stack([onward, sides + around, sides + onward], axis=1),
    )
    rims = np.concatenate([radius * ring - offset, radius * ring + offset])
    parts: list[MeshArrays] = [(rims, np.concatenate([below, above]), np.tile(ring, (2, 1)))]
    for sign in (-1.0, 1.0):
        corners = np.concatenate([radius * ring, np.zeros((1, 3))]) + sign * offset
        fan = np.stack([around, onward, np.full(sides, sides)], axis=1)
        faces = fan if sign < 0 else fan[:, ::-1]
        parts.append((corners, faces, np.tile([0, sign, 0], (sides + 1, 1))))
    return join_mesh_arrays(parts)

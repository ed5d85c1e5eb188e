"""OLAT images of a view, rendered entirely on the Taichi device: rays, shadows, reflectance and sums.

`olat.render_view` computes the same in NumPy, in strips of rows, and defines the result. Disc lamps are supported only
there.
"""
# mypy: ignore-errors
# No `from __future__ import annotations` here: Taichi reads the kernels' annotations as objects.

import math

import numpy as np

from polarsim.geometry.lens import pixel_directions, separated
from polarsim.geometry.rays import START_OFFSET
from polarsim.geometry.rays_taichi import to_device, vectors_to_device
from polarsim.geometry.taichi_device import on_taichi_thread, ti
from polarsim.geometry.taichi_walk import BOXES, FAR, NUMBERS, PAIRS, VALUES, VECTORS, WEIGHTS, walk
from polarsim.render.brdf_taichi import evaluate_brdf
from polarsim.render.hits import MIN_FACING, NO_NORMAL, Hits
from polarsim.render.lamps import REFERENCE_DISTANCE
from polarsim.render.materials import kinds_of
from polarsim.run_files.instances import BACKGROUND

_NO_ID = -1


class Pixels:
    """Hits of the n pixels of a view, in device memory; slot -1 for pixels without surface."""

    def __init__(self, count: int) -> None:
        self.slot = ti.ndarray(ti.i32, count)  # number of the face in the order of the tree
        self.weights = ti.Vector.ndarray(2, ti.f32, count)
        self.point, self.to_viewer, self.normal, self.plane = (ti.Vector.ndarray(3, ti.f32, count) for _ in range(4))

    def hits(self, face: np.ndarray, height: int) -> Hits:
        """Return the hits of the entire image as `Hits`; `face`: face numbers in the order of the tree."""
        slot = self.slot.to_numpy()
        pixel = np.flatnonzero(slot >= 0)
        point, to_viewer, normal, plane, weights = (
            array.to_numpy().take(pixel, axis=0)
            for array in (self.point, self.to_viewer, self.normal, self.plane, self.weights)
        )
        face = face.take(slot.take(pixel)).astype(np.int64)
        return Hits(slice(0, height), pixel, face, point, to_viewer, normal, plane, weights)


class _Model:
    """Parameters and albedo of a model in device memory, by id."""

    def __init__(self, model, surfaces, options, face: np.ndarray) -> None:
        kinds = kinds_of(model, surfaces, options)
        ids = int(surfaces.id_of_face.max(initial=BACKGROUND)) + 1
        of_id = np.zeros(ids) if kinds.of_id is None else kinds.of_id
        factor = np.ones(ids) if kinds.factor is None else kinds.factor
        of_vertex = surfaces.albedo.get(model)
        albedo = np.ones((1, 3)) if of_vertex is None else of_vertex[surfaces.faces[face]]
        self.parameters = kinds.parameters
        self.of_id, self.factor = to_device(np.asarray(of_id, np.int32)), to_device(np.asarray(factor, float))
        self.albedo, self.painted = vectors_to_device(albedo), int(of_vertex is not None)


@on_taichi_thread
def add_olat_images(olat_images, samples_lit, surroundings, surfaces, camera, lamps, offsets, options) -> None:
    """Add light to the OLAT images, counts to `samples_lit`, and the hits to `surroundings`.

    The arguments are variables of the caller, `olat.render_view`; the rays of the surfaces must use Taichi.
    """
    caster = surfaces.all
    if caster.empty:
        return
    lens, on_device = camera.lens, caster.on_device()
    count = lens.height * lens.width
    face = caster.order
    id_of_slot = to_device(surfaces.id_of_face[face].astype(np.int32))
    corner_normals = vectors_to_device(surfaces.corner_normals.take(face, axis=0))
    names = dict.fromkeys(name for _, name in olat_images)
    models = {
        model: _Model(model, surfaces, options, face) for model in dict.fromkeys(model for model, _ in olat_images)
    }
    sums = {key: ti.ndarray(ti.f32, count) for key in olat_images}
    lit = {name: ti.ndarray(ti.i32, count) for name in lamps}
    pixels, to_lamp = Pixels(count), ti.Vector.ndarray(3, ti.f32, count)
    share, value, upward, covered = (ti.ndarray(ti.f32, count) for _ in range(4))
    for array in (*sums.values(), *lit.values(), upward, covered):
        array.fill(0)
    directions = ti.Vector.ndarray(3, ti.f32, count)
    rotation = ti.Matrix(camera.world_from_camera.rotation.tolist(), ti.f32)
    origin = ti.Vector(camera.centre.tolist(), ti.f32)
    plain_id = _NO_ID if options.wall_albedo is None else BACKGROUND
    plain = (options.wall_albedo or 0.0) / math.pi
    for offset in offsets:
        _fill_directions(directions, lens, offset)
        _intersect(
            *on_device.tree, corner_normals, directions, rotation, origin, 1 / len(offsets),
            pixels.slot, pixels.weights, pixels.point, pixels.to_viewer, pixels.normal, pixels.plane, upward, covered,
        )  # fmt: skip
        if not surroundings.even:
            surroundings.add(pixels.hits(face, lens.height), len(offsets))
        for name in names:
            lamp = lamps[name]
            near_lamp = options.falloff and not lamp.distant
            _light(
                *on_device.tree, pixels.slot, pixels.point, pixels.normal, pixels.plane,
                ti.Vector(lamp.position.tolist(), ti.f32), lamp.intensity / len(offsets), int(near_lamp),
                to_lamp, share, lit[name],
            )  # fmt: skip
            for model, material in models.items():
                for number, parameters in enumerate(material.parameters):
                    value.fill(0)
                    evaluate_brdf(parameters, pixels.normal, to_lamp, pixels.to_viewer, value)
                    _add(
                        value, share, pixels.slot, pixels.weights, id_of_slot, material.of_id, number, material.factor,
                        material.albedo, material.painted, plain_id, plain, sums[model, name],
                    )  # fmt: skip
    for key, olat_image in olat_images.items():
        olat_image += sums[key].to_numpy().reshape(olat_image.shape)
    for name, picture in samples_lit.items():
        picture += lit[name].to_numpy().reshape(picture.shape).astype(picture.dtype)
    if surroundings.even:
        surroundings.accumulate(
            {"bounce": upward.to_numpy().reshape(lens.shape), "ambient": covered.to_numpy().reshape(lens.shape)}
        )


def _fill_directions(directions, lens, offset) -> None:
    """Fill the directions (n,) through all pixels, in the camera frame."""
    parts = separated(lens, offset)
    if parts is None:
        directions.from_numpy(pixel_directions(lens, slice(None), offset).reshape(-1, 3).astype(np.float32))
    else:
        _multiply(*(part.astype(np.float32) for part in parts), lens.width, directions)


@ti.kernel
def _multiply(
    of_row: ti.types.ndarray(dtype=ti.math.vec2, ndim=2), of_column: ti.types.ndarray(dtype=ti.f32, ndim=2),
    width: ti.i32, directions: VECTORS,
):  # fmt: skip
    for n in directions:
        row, column = n // width, n % width
        x = y = 0.0
        for term in range(of_column.shape[1]):
            x += of_row[row, term][0] * of_column[column, term]
            y += of_row[row, term][1] * of_column[column, term]
        directions[n] = ti.math.vec3(x, y, 1.0)


@ti.func
def _unit(vector):
    square = vector.dot(vector)
    length = ti.sqrt(square)
    if square == 0:
        length = 1.0
    return vector / length


@ti.kernel
def _intersect(
    boxes: BOXES, children: PAIRS, corners: BOXES, corner_normals: BOXES,
    directions: VECTORS, rotation: ti.math.mat3, origin: ti.math.vec3, share: ti.f32,
    slot: NUMBERS, weights: WEIGHTS, point: VECTORS, to_viewer: VECTORS, normal: VECTORS, plane: VECTORS,
    upward: VALUES, covered: VALUES,
):  # fmt: skip
    """Apply `hits.nearest_surface_hits` to rays along camera-frame directions; add the shares of `olat.DiffuseLight`.

    `upward` gets the share of light from above that each hit faces, `covered` the share of samples with a hit.
    """
    for n in slot:
        along = rotation @ directions[n]
        first = walk(boxes, children, corners, origin, along, 0.0, FAR, 0)
        slot[n] = first.slot
        if first.slot >= 0:
            s, w = first.slot, ti.math.vec3(1 - first.weights.sum(), first.weights)
            back = _unit(-along)
            flat = _unit((corners[s, 1] - corners[s, 0]).cross(corners[s, 2] - corners[s, 0]))
            side = 1.0
            if flat.dot(back) < 0:  # open meshes may be visible from inside
                side = -1.0
            flat *= side
            smooth = corner_normals[s, 0] * w[0] + corner_normals[s, 1] * w[1] + corner_normals[s, 2] * w[2]
            if smooth.dot(smooth) > NO_NORMAL:
                smooth = _unit(smooth) * side
            if smooth.dot(back) < MIN_FACING:  # or they cancel out
                smooth = flat
            weights[n], point[n], to_viewer[n] = first.weights, origin + first.distance * along, back
            normal[n], plane[n] = smooth, flat
            upward[n] += share * (1 + smooth[2]) / 2
            covered[n] += share


@ti.kernel
def _light(
    boxes: BOXES, children: PAIRS, corners: BOXES,
    slot: NUMBERS, point: VECTORS, normal: VECTORS, plane: VECTORS,
    lamp: ti.math.vec3, intensity: ti.f32, falloff: ti.i32,
    to_lamp: VECTORS, share: VALUES, lit: NUMBERS,
):  # fmt: skip
    """Apply `lighting.lighting`: write the irradiance of each pixel, 0 if the lamp is occluded."""
    for n in slot:
        share[n] = 0.0
        to_lamp[n] = -normal[n]  # no reflectance is computed for this direction
        if slot[n] >= 0:
            towards = lamp - point[n]
            along_normal = normal[n].dot(towards)
            if plane[n].dot(towards) > 0 and along_normal > 0:
                square = towards.dot(towards)
                distance = ti.sqrt(square)
                near = START_OFFSET / distance
                if walk(boxes, children, corners, point[n], towards, near, 1.0, 1).slot < 0:
                    irradiance = intensity
                    if falloff:
                        irradiance *= REFERENCE_DISTANCE * REFERENCE_DISTANCE / square
                    to_lamp[n] = towards / distance
                    share[n] = irradiance * along_normal / distance
                    lit[n] += 1


@ti.kernel
def _add(
    value: VALUES, share: VALUES, slot: NUMBERS, weights: WEIGHTS, id_of_slot: NUMBERS,
    kind_of_id: NUMBERS, kind: ti.i32, factor: VALUES, albedo: VECTORS, painted: ti.i32,
    plain_id: ti.i32, plain: ti.f32, olat_image: VALUES,
):  # fmt: skip
    """Add `materials.Materials.reflectance` times irradiance for the objects of a single kind."""
    for n in olat_image:
        if share[n] > 0 and value[n] > 0:
            thing = id_of_slot[slot[n]]
            if kind_of_id[thing] == kind:
                f = value[n] * factor[thing]
                if painted:
                    corners = albedo[slot[n]]
                    f *= (
                        corners[0]
                        + weights[n][0] * (corners[1] - corners[0])
                        + weights[n][1] * (corners[2] - corners[0])
                    )
                if thing == plain_id:
                    f = plain
                olat_image[n] += f * share[n]

"""Traversal of a tree of boxes by a ray, as a Taichi function: nearest hit or any hit.

Triangles are tested as by Woop, Benthin and Wald (J. Computer Graphics Techniques 2:1 (2013) 65): sheared so that the
ray is an axis, both triangles of an edge compute the same edge. If the ray seems to pass through the edge, they repeat
the test in double precision, which Vulkan need not provide, and compilers may fuse products with sums. This function
accepts a hit on both sides of an edge if rounding errors may hide it, so that no ray passes between triangles. Boxes
are enlarged by the same error (after Ize, ibid. 2:2 (2013) 12).
"""
# mypy: ignore-errors
# No `from __future__ import annotations`: Taichi reads the annotations as objects.

from polarsim.geometry.bvh import COUNT_BITS, LEVELS
from polarsim.geometry.taichi_device import ti

FAR = 1e36  # greater than all distances, and small enough for sums in float32
# Types of the kernels' arrays.
VECTORS, BOXES = (ti.types.ndarray(dtype=ti.math.vec3, ndim=ndim) for ndim in (1, 2))
VALUES, WEIGHTS = (ti.types.ndarray(dtype=dtype, ndim=1) for dtype in (ti.f32, ti.math.vec2))
NUMBERS, PAIRS = (ti.types.ndarray(dtype=ti.i32, ndim=ndim) for ndim in (1, 2))
_MIN_COMPONENT = 1e-18  # minimum component of directions, so that its inverse is finite
_ROUNDING = 2.0**-21  # relative error of a difference of two products: four times that of float32
_WIDER = 2.0**-20  # share of the distance to a box by which it is enlarged
_NO_NODE = 0x7FFFFFFF


@ti.dataclass
class Walk:
    distance: ti.f32  # in lengths of the direction; inf without a triangle
    slot: ti.i32  # index in the tree's order; -1 without one
    weights: ti.math.vec2  # barycentric, of the second and third corner


@ti.func
def _inverse(x):
    """Return 1 / x; a large number of the same sign for zero."""
    safe = x
    if ti.abs(x) < _MIN_COMPONENT:
        safe = _MIN_COMPONENT
        if x < 0:
            safe = -_MIN_COMPONENT
    return 1 / safe


@ti.func
def _through_box(low, high, origin, inverse, wider, near, far):
    """Return the distance at which the ray enters the box; FAR if it does not before `far`."""
    a, b = (low - wider - origin) * inverse, (high + wider - origin) * inverse
    enters = ti.max(ti.min(a, b).max(), near)
    leaves = ti.min(ti.max(a, b).min(), far)
    distance = FAR
    if enters <= leaves:
        distance = enters
    return distance


@ti.func
def _sheared(corner, origin, shear, axis):
    """Transform a corner to the ray's frame: two coordinates across the ray, the third in lengths of the direction."""
    p = corner - origin
    permuted = ti.math.vec3(p[1], p[2], p[0])
    if axis == 1:
        permuted = ti.math.vec3(p[2], p[0], p[1])
    if axis == 2:
        permuted = p
    return ti.math.vec3(
        permuted[0] - shear[0] * permuted[2], permuted[1] - shear[1] * permuted[2], shear[2] * permuted[2]
    )


@ti.func
def _shear(along):
    """Return the shear of a direction and its longest axis, 0 to 2, as a float."""
    size = ti.abs(along)
    permuted, axis = ti.math.vec3(along[1], along[2], along[0]), 0
    if size[1] > size[0] and size[1] >= size[2]:
        permuted, axis = ti.math.vec3(along[2], along[0], along[1]), 1
    elif size[2] > size[0] and size[2] > size[1]:
        permuted, axis = along, 2
    return ti.math.vec4(permuted[0] / permuted[2], permuted[1] / permuted[2], 1 / permuted[2], axis)


@ti.func
def _edge(a, b):
    """Return twice the area between the ray and an edge, and its error bound."""
    first, second = a[0] * b[1], a[1] * b[0]
    return ti.math.vec2(first - second, _ROUNDING * (ti.abs(first) + ti.abs(second)))


@ti.func
def _in_triangle(a, b, c):
    """Return the weights of the sheared corners at the ray, with sum 1; all 0 outside the triangle."""
    u, v, w = _edge(c, b), _edge(a, c), _edge(b, a)
    value, off = ti.math.vec3(u[0], v[0], w[0]), ti.math.vec3(u[1], v[1], w[1])
    inside = ti.math.vec3(0.0)
    if (value + off).min() >= 0:
        inside = ti.max(value, 0.0)
    if (value - off).max() <= 0 and -value.sum() > inside.sum():
        inside = ti.max(-value, 0.0)
    total = inside.sum()
    if total > 0:
        inside = inside / total
    return inside


@ti.func
def walk(
    boxes: ti.template(), children: ti.template(), corners: ti.template(),
    origin, along, near, far, any_will_do: ti.template(),
):  # fmt: skip
    """Return the nearest triangle between `near` and `far` lengths of the direction; `near` is exclusive if above 0.

    `any_will_do`: return the first triangle that is found, at any distance.
    """
    found = Walk(distance=far, slot=-1)
    inverse = ti.math.vec3(_inverse(along[0]), _inverse(along[1]), _inverse(along[2]))
    sheared = _shear(along)
    shear, axis = sheared.xyz, ti.cast(sheared[3], ti.i32)
    reach = ti.max(ti.max(ti.abs(boxes[0, 0] - origin), ti.abs(boxes[0, 1] - origin)).max(),
                   ti.max(ti.abs(boxes[0, 2] - origin), ti.abs(boxes[0, 3] - origin)).max())  # fmt: skip
    wider = _WIDER * (reach + ti.abs(origin).max())
    stack = ti.Vector([0] * LEVELS, ti.i32)
    top = 0
    node = 0
    while node != _NO_NODE:
        following = _NO_NODE
        if node >= 0:
            first, second = children[node, 0], children[node, 1]
            to_first = _through_box(boxes[node, 0], boxes[node, 1], origin, inverse, wider, near, found.distance)
            to_second = _through_box(boxes[node, 2], boxes[node, 3], origin, inverse, wider, near, found.distance)
            if to_second < to_first:
                first, second = second, first
                to_first, to_second = to_second, to_first
            if to_first < FAR:
                following = first
            if to_second < FAR:
                stack[top] = second
                top += 1
        else:
            start, count = ~node >> COUNT_BITS, ~node & ((1 << COUNT_BITS) - 1)
            for slot in range(start, start + count):
                a = _sheared(corners[slot, 0], origin, shear, axis)
                b = _sheared(corners[slot, 1], origin, shear, axis)
                c = _sheared(corners[slot, 2], origin, shear, axis)
                weights = _in_triangle(a, b, c)
                if weights.sum() > 0:
                    distance = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]
                    after_start = distance > near or (near == 0 and distance == 0)
                    if after_start and distance < found.distance:
                        found.distance, found.slot, found.weights = distance, slot, weights.yz
            if any_will_do and found.slot >= 0:
                top = 0
        if following == _NO_NODE and top > 0:
            top -= 1
            following = stack[top]
        node = following
    if found.slot < 0:
        found.distance = FAR
    return found

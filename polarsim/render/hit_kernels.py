"""Compiled loops over the hits of a strip: the arithmetic of `hits` and `lighting` in a single pass.

Vectors (n, 3) are passed as flat arrays, because the compiler vectorises loops with a known stride of 3. Results equal
those of the same steps in NumPy to the last bit, in the precision of the arrays.
"""

from __future__ import annotations

import numpy as np

from polarsim.kernels import njit

_f = np.float32
_0, _1 = _f(0), _f(1)
_loop = njit(nogil=True, error_model="numpy")
_helper = njit(nogil=True, error_model="numpy", inline="always")


def rows(vectors: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return `vectors.take(numbers, axis=0)` of vectors (n, 3), three times as fast."""
    out = np.empty((len(numbers), 3), vectors.dtype)
    _rows(vectors.reshape(-1), numbers, out.reshape(-1))
    return out


@_helper
def _dot(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    return ax * bx + ay * by + az * bz


@_helper
def _inverse_length(x, y, z):  # type: ignore[no-untyped-def]
    """Return the inverse length of a float32 vector; 1 for a zero vector."""
    square = _dot(x, y, z, x, y, z)
    return _1 / np.sqrt(square if square > _0 else _1)


@_loop
def rotated(rotation, vectors, out):  # type: ignore[no-untyped-def]
    """Write vectors, rotated by a matrix (9,), to `out`."""
    for k in range(len(vectors) // 3):
        x, y, z = vectors[3 * k], vectors[3 * k + 1], vectors[3 * k + 2]
        out[3 * k] = rotation[0] * x + rotation[1] * y + rotation[2] * z
        out[3 * k + 1] = rotation[3] * x + rotation[4] * y + rotation[5] * z
        out[3 * k + 2] = rotation[6] * x + rotation[7] * y + rotation[8] * z


@_loop
def hit_points(ray, distance, origins, directions, point, to_viewer):  # type: ignore[no-untyped-def]
    """Write the end points of rays `ray` (m,), float32, and unit vectors to the origins.

    `origins` has an origin for each ray or a common origin.
    """
    each = 3 if len(origins) == len(directions) else 0
    for k in range(len(ray)):
        line, start = 3 * ray[k], each * ray[k]
        x, y, z = directions[line], directions[line + 1], directions[line + 2]
        point[3 * k] = origins[start] + distance[k] * x
        point[3 * k + 1] = origins[start + 1] + distance[k] * y
        point[3 * k + 2] = origins[start + 2] + distance[k] * z
        x, y, z = -_f(x), -_f(y), -_f(z)
        scale = _inverse_length(x, y, z)
        to_viewer[3 * k], to_viewer[3 * k + 1], to_viewer[3 * k + 2] = x * scale, y * scale, z * scale


@_loop
def planes(normal, to_viewer, plane, side):  # type: ignore[no-untyped-def]
    """Write the unit normals (m,) of flat faces towards the viewer and the visible side: 1 front, -1 back."""
    for k in range(len(side)):
        x, y, z = _f(normal[3 * k]), _f(normal[3 * k + 1]), _f(normal[3 * k + 2])
        scale = _inverse_length(x, y, z)
        x, y, z = x * scale, y * scale, z * scale
        facing = _dot(x, y, z, to_viewer[3 * k], to_viewer[3 * k + 1], to_viewer[3 * k + 2])
        side[k] = -_1 if facing < _0 else _1
        plane[3 * k], plane[3 * k + 1], plane[3 * k + 2] = x * side[k], y * side[k], z * side[k]


@_loop
def smooth_normals(  # type: ignore[no-untyped-def]
    face, weights, corner_normals, side, plane, to_viewer, min_square, min_facing, normal
):
    """Write interpolated unit normals from the corner normals (9 f,), on the visible side of the face.

    The flat normal replaces normals that cancel out or are almost orthogonal to the viewing direction.
    """
    for k in range(len(face)):
        corner, second, third = 9 * face[k], _f(weights[2 * k]), _f(weights[2 * k + 1])
        first = _1 - second - third
        c = corner_normals
        x = c[corner] * first + c[corner + 3] * second + c[corner + 6] * third
        y = c[corner + 1] * first + c[corner + 4] * second + c[corner + 7] * third
        z = c[corner + 2] * first + c[corner + 5] * second + c[corner + 8] * third
        scale = _inverse_length(x, y, z)
        defined = _1 if _dot(x, y, z, x, y, z) > min_square else _0
        x, y, z = x * scale * defined * side[k], y * scale * defined * side[k], z * scale * defined * side[k]
        slope = _dot(x, y, z, to_viewer[3 * k], to_viewer[3 * k + 1], to_viewer[3 * k + 2])
        flat = slope < min_facing
        normal[3 * k] = plane[3 * k] if flat else x
        normal[3 * k + 1] = plane[3 * k + 1] if flat else y
        normal[3 * k + 2] = plane[3 * k + 2] if flat else z


@_loop
def facing(plane, normal, to_lamp, irradiance, number):  # type: ignore[no-untyped-def]
    """Write the numbers of the points that face a lamp, by flat and smooth normal, and get light; return the count."""
    count = 0
    for k in range(len(irradiance)):
        x, y, z = to_lamp[3 * k], to_lamp[3 * k + 1], to_lamp[3 * k + 2]
        flat = _dot(plane[3 * k], plane[3 * k + 1], plane[3 * k + 2], x, y, z) > 0
        smooth = _dot(normal[3 * k], normal[3 * k + 1], normal[3 * k + 2], x, y, z) > 0
        number[count] = k
        count += flat & smooth & (irradiance[k] > 0)
    return count


@_loop
def beams(chosen, normal, to_lamp, irradiance, direction, received):  # type: ignore[no-untyped-def]
    """Write unit vectors to the lamp and the irradiance of the surface at the chosen points."""
    for k in range(len(chosen)):
        p = 3 * chosen[k]
        x, y, z = to_lamp[p], to_lamp[p + 1], to_lamp[p + 2]
        along_normal = _dot(normal[p], normal[p + 1], normal[p + 2], x, y, z)
        scale = _1 / np.sqrt(_dot(x, y, z, x, y, z))
        direction[3 * k], direction[3 * k + 1], direction[3 * k + 2] = x * scale, y * scale, z * scale
        received[k] = irradiance[chosen[k]] * along_normal * scale


@_loop
def add(strip, pixel, value, share):  # type: ignore[no-untyped-def]
    """Add values times shares to distinct pixels of a flat strip."""
    for k in range(len(pixel)):
        strip[pixel[k]] += value[k] * share[k]


@_loop
def _rows(vectors, numbers, out):  # type: ignore[no-untyped-def]
    for k in range(len(numbers)):
        p = 3 * numbers[k]
        out[3 * k], out[3 * k + 1], out[3 * k + 2] = vectors[p], vectors[p + 1], vectors[p + 2]


@_loop
def kept(numbers, hidden):  # type: ignore[no-untyped-def]
    """Move the numbers of visible points to the front of the array; return the count."""
    count = 0
    for k in range(len(numbers)):
        numbers[count] = numbers[k]
        count += not hidden[k]
    return count

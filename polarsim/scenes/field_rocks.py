"""Rocks, gravel and parts of vehicles on the ground of scenes beyond the sandbox."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from polarsim.geometry.meshes import Mesh
from polarsim.render.surfaces import box_mesh
from polarsim.scenes.field_options import TARGET_M, FieldRanges, log_uniform
from polarsim.scenes.field_view import FieldView
from polarsim.scenes.layout import RockShape, draw_rotation, drop_rock, power_law

_TRIES = 8  # number of candidate positions of a rock
_PILE_ROCKS = 8  # rocks of a scene per pile
_PILE_SPREAD = 0.6  # standard deviation of the position in a pile, over the size of the rock
_TRIANGLE_PX = 2.0  # maximum side of the triangles of a rock in the image, if the shape is fine enough
_TUMBLED_SHARE, _TILT_SD_DEG = 0.5, 8  # share of rocks tilted at random; tilt of the others, which lie flat
_CLEARANCE = 0.8  # minimum distance of a rock from the camera over its size
_EVENNESS = (0.0, 0.6)  # from even in the image (0) to even on the ground (1)
_LAYERED_SHARE, _LAYER_DEPTH = 0.35, (0.01, 0.08)  # share of layered rocks; depth over the size of a rock, log-uniform
_ROUGH_SHARE, _RELIEF = 0.6, (0.004, 0.05)  # share of rough rocks; standard deviation over the size, log-uniform
_PITTED_SHARE = 0.35  # share of rough rocks with pits instead of bumps
_COARSEST, _FINEST = 0.5, 1 / 32  # range of the structure of relief over the size
_LATTICE = 16  # side of the periodic lattice of an octave
_SIDES = 24  # of a wheel
_GOLDEN = (1 + np.sqrt(5)) / 2
_CORNERS = np.array(  # icosahedron
    [turned for a in (-1, 1) for b in (-_GOLDEN, _GOLDEN) for turned in ((0, a, b), (a, b, 0), (b, 0, a))], float
) / np.hypot(1, _GOLDEN)


def scatter_field_rocks(
    shapes: Sequence[RockShape],
    view: FieldView,
    heights: np.ndarray,
    ranges: FieldRanges,
    random: np.random.Generator,
) -> list[Mesh]:
    """Place single rocks and piles of rocks on ground with heights (rows, columns) at the nodes of a view.

    Sizes follow a power law between the minimum and a random maximum, in metres or relative to the width of the image
    at the position. Large rocks are placed first. Each rock is dropped until it touches the ground or a rock and then
    lowered by a share of its height.
    """
    count = round(log_uniform(ranges.rocks, random))
    power, largest = random.uniform(*ranges.size_power), log_uniform(ranges.largest, random)
    sizes = power_law(count, (ranges.smallest, largest), power, random)
    near = int(random.integers(1, ranges.near_rocks + 1)) if random.random() < ranges.near_share else 0
    low, high = np.log(ranges.near_size).tolist()
    sizes = np.append(sizes, np.exp(random.uniform(low, high, near)))
    in_image = np.append(np.full(count, random.random() >= ranges.perspective_share), np.ones(near, bool))
    order = np.argsort(-sizes, kind="stable")
    piled = random.random(len(sizes)) < random.uniform(*ranges.piled_share)
    evenness = random.uniform(*_EVENNESS)
    piles = view.draw_points(max(1, round(count / _PILE_ROCKS)), evenness, random)
    centres, extents = np.zeros((0, 2)), np.zeros(0)
    top, rocks = heights.copy(), []
    for size, relative, in_pile in zip(sizes[order], in_image[order], piled[order], strict=True):
        if in_pile:
            pile = piles[random.integers(len(piles))]
            candidates = pile + _PILE_SPREAD * size * view.width_at(pile[0]) * random.standard_normal((1, 2))
        else:
            candidates = view.draw_points(_TRIES, evenness, random)
        size_m = size * (view.width_at(candidates[:, 0]) if relative else np.full(len(candidates), view.width))
        clear = np.hypot(np.hypot(*candidates.T), view.height) > _CLEARANCE * size_m
        if not clear.any():
            continue
        candidates, size_m = candidates[clear], size_m[clear]
        gaps = np.hypot(*np.moveaxis(candidates[:, None] - centres, -1, 0)) - (size_m[:, None] + extents) / 2
        room = gaps.min(axis=1, initial=np.inf)
        best = int(np.argmax(np.minimum(room, 0)))  # the first free position, or the one with most room
        position, extent = candidates[best], float(size_m[best])
        centres, extents = np.vstack([centres, position]), np.append(extents, extent)
        pixel_m = float(view.depth_at(position[0])) / view.camera.lens.fx
        side = min(_TRIANGLE_PX * pixel_m / extent, 1.0)
        copy = shapes[int(random.integers(len(shapes)))].mesh(1.0, side)
        vertices = extent * weather(copy.vertices, side, random)
        rotation = draw_rotation(_TUMBLED_SHARE, _TILT_SD_DEG, random).as_matrix()
        points = vertices @ rotation.T + np.array([*position, 0.0])
        drop_rock(points, top, view.cells_of(points), random.uniform(*ranges.sunk) ** 2)
        rocks.append(Mesh(points, copy.faces))
    return rocks


def weather(vertices: np.ndarray, finest: float, random: np.random.Generator) -> np.ndarray:
    """Return vertices (v, 3) of a rock of unit size stretched, cut, layered and roughened at random to unit size.

    Scanned and carved rocks are few and smooth: their shapes would otherwise be repeated, and a detector would take
    every edge inside a real rock for the boundary of a smaller rock. `finest`: side of the triangles.
    """
    points = vertices * np.exp(random.normal(0, 0.25, 3))
    for _ in range(random.integers(7)):  # facets of angular rocks
        normal = random.standard_normal(3)
        normal /= np.linalg.norm(normal)
        height = points @ normal
        excess = np.maximum(height - random.uniform(0.35, 0.95) * height.max(), 0)
        points = points - random.uniform(0.7, 1.0) * excess[:, None] * normal
    if random.random() < _LAYERED_SHARE:
        points = _layered(points, random)
    if random.random() < _ROUGH_SHARE:
        relief = rock_noise(points, finest, random.uniform(0.3, 1.0), random)
        if random.random() < _PITTED_SHARE:
            relief = -2 * np.maximum(relief - random.uniform(-0.2, 0.8), 0)
        distance = np.linalg.norm(points, axis=1, keepdims=True)
        points = points * (1 + log_uniform(_RELIEF, random) * relief[:, None] / np.maximum(distance, 0.1))
    if random.random() < 0.3:  # slabs
        points = points * [1, 1, random.uniform(0.3, 0.6)]
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - (low + high) / 2) / (high - low).max())


def _layered(points: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the points (v, 3) of a rock with layers that are eroded to different depths, at a slight tilt."""
    axis = np.array([*random.normal(0, 0.3, 2), 1.0])
    axis /= np.linalg.norm(axis)
    height = points @ axis
    count = int(random.integers(4, 25))
    ends = np.sort(random.uniform(height.min(), height.max(), count))
    places = np.stack([ends, ends + random.uniform(0.1, 0.8) * np.diff(ends, append=height.max())], axis=1).ravel()
    depth = log_uniform(_LAYER_DEPTH, random) * np.interp(height, places, random.standard_normal(count).repeat(2))
    across = points - height[:, None] * axis
    return np.asarray(points + depth[:, None] * across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 0.1))


def rock_noise(points: np.ndarray, finest: float, hurst: float, random: np.random.Generator) -> np.ndarray:
    """Return noise (v,) at points (v, 3) of a rock of unit size, with structure from half a rock to `finest`; sd 1."""
    total, amplitude, length = np.zeros(len(points)), 1.0, _COARSEST
    turned = points @ Rotation.random(random_state=random).as_matrix()
    while length >= max(2 * finest, _FINEST) or length == _COARSEST:
        lattice = random.standard_normal((_LATTICE,) * 3)
        places = turned.T / length + random.uniform(0, _LATTICE, (3, 1))
        total += amplitude * map_coordinates(lattice, places, order=1, mode="grid-wrap")
        amplitude, length = amplitude * 2**-hurst, length / 2
    return np.asarray(total / max(float(total.std()), 1e-9))


def scatter_gravel(view: FieldView, heights: np.ndarray, ranges: FieldRanges, random: np.random.Generator) -> Mesh:
    """Return a mesh of stones below the size of labels, on ground with heights (rows, columns)."""
    count = round(log_uniform(ranges.gravel, random))
    position = view.draw_points(count, random.uniform(0, 0.3), random)
    size = power_law(count, ranges.gravel_size, 1.5, random) * view.width_at(position[:, 0]) / 2
    radii = size[:, None] * random.uniform(0.4, 1, (count, 3))
    stones = _CORNERS * random.uniform(0.75, 1.1, (count, 12, 1)) * radii[:, None]
    stones = np.einsum("nij,nvj->nvi", Rotation.random(count, random_state=random).as_matrix(), stones)
    stones[..., 2] += heights[view.cells_of(position)][:, None] + 0.3 * size[:, None]
    stones[..., :2] += position[:, None]
    hull = ConvexHull(_CORNERS)
    flipped = np.einsum("na,na->n", hull.equations[:, :3], np.cross(*_edges(_CORNERS, hull.simplices))) < 0
    faces = np.where(flipped[:, None], hull.simplices[:, ::-1], hull.simplices)
    return Mesh(stones.reshape(-1, 3), (faces + 12 * np.arange(count)[:, None, None]).reshape(-1, 3))


def draw_parts(view: FieldView, random: np.random.Generator) -> list[Mesh]:
    """Return parts of a rover or lander: wheels and beams in the image, or a body behind the camera for its shadow."""
    parts = []
    for _ in range(random.integers(1, 4)):
        position = view.draw_points(3, 0.0, random)
        position = position[np.argmin(position[:, 0])]  # mostly in the foreground
        width = float(view.width_at(position[0]))
        kind = random.random()
        if kind < 0.4:
            radius = random.uniform(0.08, 0.3) * width
            part = _wheel(radius, random.uniform(0.5, 1.4) * radius)
            turn = Rotation.from_euler("z", random.uniform(0, 2 * np.pi)).as_matrix()
            place = np.array([*position, 0.9 * radius])
        elif kind < 0.8 or view.forward[0] <= 0:
            low, high = -random.uniform(0.02, 0.12, 3) * width, random.uniform(0.02, 0.12, 3) * width
            low[0], high[0] = -random.uniform(0.1, 0.8) * width, random.uniform(0.1, 0.8) * width
            part = Mesh(*box_mesh(low, high)[:2])
            turn = Rotation.random(random_state=random).as_matrix()
            place = np.array([*position, random.uniform(0.1, 0.4) * width])
        else:
            half = random.uniform(0.1, 0.6, 3) * TARGET_M
            part = Mesh(*box_mesh(-half, half)[:2])
            turn = np.eye(3)
            place = np.array([-half[0] - 0.1 * TARGET_M, random.uniform(-0.5, 0.5) * TARGET_M, half[2]])
        if np.linalg.norm(place - view.camera.centre) < 1.2 * np.linalg.norm(part.vertices, axis=1).max():
            continue  # would contain the camera
        parts.append(Mesh(part.vertices @ turn.T + place, part.faces))
    return parts


def _wheel(radius: float, width: float) -> Mesh:
    """Return a closed cylinder along y with sharp edges."""
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    circle = radius * np.stack([np.cos(angle), np.zeros(_SIDES), np.sin(angle)], axis=1)
    half = np.array([0, width / 2, 0])
    left, right, ends = circle - half, circle + half, np.stack([-half, half])
    n, following = np.arange(_SIDES), (np.arange(_SIDES) + 1) % _SIDES
    side = np.concatenate(
        [
            np.stack([n, n + _SIDES, following + _SIDES], axis=1),
            np.stack([n, following + _SIDES, following], axis=1),
        ]
    )
    first, second, centre = 2 * _SIDES, 3 * _SIDES, 4 * _SIDES
    caps = [
        np.stack([first + n, first + following, np.full(_SIDES, centre)], axis=1),
        np.stack([second + following, second + n, np.full(_SIDES, centre + 1)], axis=1),
    ]
    return Mesh(np.concatenate([left, right, left, right, ends]), np.concatenate([side, *caps]))


def _edges(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return b - a, c - a

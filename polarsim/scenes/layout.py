"""Strewn scenes: rocks of one terrain laid out anew on made-up sand, in materials drawn at random.

No layout is ever drawn twice, so that what a detector can learn from such pictures is rocks, not places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.geometry.camera import Camera
from polarsim.geometry.heightfields import grid_mesh, smooth_noise
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK
from polarsim.render.options import HapkeParameters, Material, Model, PrincipledParameters, RenderOptions
from polarsim.rocks.solids import decimated
from polarsim.run_files.scene import TerrainMesh
from polarsim.scenes.options import Range, SceneRanges
from polarsim.scenes.relief import draw_relief
from polarsim.scenes.viewpoints import draw_camera

FIRST_ROCK = 1  # number of the first rock of a scene; what a rock was called in its terrain is no part of it
_TRIES = 12  # positions that are tried before a rock is laid where most room was
_MOST_HALVINGS = 6  # of a rock's extent to the sides of its triangles: 24,000 of them
_FACES_OF_WHOLE_SIDES = 6  # triangles with sides of 1 that a rock of that extent has
_PILE_SPREAD = 0.6  # rocks of a pile lie so far from its centre, times their mean size
_PILE_ROCKS = 8  # rocks of a scene to one in a pile
_EVEN_CELL_M = 0.25  # points within such cells share their chance
_CAMERA_ROOM_M = 0.8  # width of what no rock stands in, about the camera's foot
_MARGIN_M = 0.1  # of sand around what is seen
_MOST_CELLS = 270  # of the ground's mesh along the longer side of what is seen: as fine as pictures show
_EVENNESS = (0.0, 1.0)  # from rocks strewn evenly over the picture, 0, to evenly over the sand, 1
_WALLED_M, _OPEN_M = 2.05, 3.0  # half the width of the sand inside walls and without them
# Ranges, from least to most, about what is known of the sandbox and of sands.
_WALL_HEIGHT_M, _WALL_ALBEDO = (0.2, 0.36), (0.2, 0.9)  # photos show tops of 0.29 to 0.36 m
_HAPKE_B, _HAPKE_C, _HAPKE_THETA_DEG = (0.15, 0.4), (-0.2, 0.6), (10, 35)  # lobes' width and weight; roughness
_AMBIENT = (0.0, 0.02)  # even light over a lamp's irradiance: the hall is dark
_TRIANGLE_PX = 1.5  # sides of the triangles of rocks in the picture, at least where they were scanned so finely


@dataclass(frozen=True)
class Scene:
    """A scene to render: its mesh, its vertices' albedo factors (v,), who looks at it, and how."""

    mesh: TerrainMesh
    albedo: np.ndarray
    camera: Camera
    options: RenderOptions


class Shape:
    """A rock without a pose: centre at the origin, longest extent 1. Copies with fewer faces are made once."""

    def __init__(self, mesh: Mesh) -> None:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        self.size_m = float((high - low).max())
        self._copies: dict[int, Mesh] = {}
        self._whole = Mesh((mesh.vertices - (low + high) / 2) / self.size_m, mesh.faces)

    def mesh(self, size_m: float, side_m: float) -> Mesh:
        """The rock of a size, the sides of its triangles about `side_m` or shorter, where it was scanned so finely.

        Both in metres. Sides of a copy's triangles are 1/4, 1/8 ... 1/64 of the rock's longest extent.
        """
        halvings = int(np.clip(np.ceil(np.log2(size_m / side_m)), 2, _MOST_HALVINGS))
        found = self._copy(halvings)
        return Mesh(size_m * found.vertices, found.faces)

    def _copy(self, halvings: int) -> Mesh:
        """The copy with such sides, made of the next finer one: of the whole rock it would take longer."""
        if halvings not in self._copies:
            finer = self._whole if halvings == _MOST_HALVINGS else self._copy(halvings + 1)
            faces = _FACES_OF_WHOLE_SIDES * 4**halvings
            self._copies[halvings] = decimated(finer, faces / len(finer.faces))
        return self._copies[halvings]


def draw_scene(shapes: Sequence[Shape], ranges: SceneRanges, random: np.random.Generator) -> Scene:
    """One scene of rocks of these shapes."""
    chosen = draw_render_options(ranges, random)
    camera, seen = draw_camera(chosen, ranges, random)
    grid = _grid_around(seen, chosen.rim_half_width_m, ranges)
    relief = draw_relief(*grid, ranges, random)
    ground = grid_mesh(*grid, relief)
    vertices, faces, rock_of_face = [ground.vertices], [ground.faces], [np.full(len(ground.faces), NO_ROCK)]
    albedo = [patches(relief.shape, random.uniform(*ranges.patch_sd), random)]
    count = len(ground.vertices)
    rocks_albedo = random.uniform(*ranges.rock_albedo)
    for number, mesh in enumerate(strew(shapes, grid, relief, camera, seen, ranges, random), FIRST_ROCK):
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + count)
        rock_of_face.append(np.full(len(mesh.faces), number))
        own = rocks_albedo * max(0.3, 1 + ranges.rock_spread * random.standard_normal())
        albedo.append(np.full(len(mesh.vertices), own, np.float32))
        count += len(mesh.vertices)
    whole = TerrainMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(rock_of_face))
    return Scene(whole, np.concatenate(albedo).astype(np.float32), camera, chosen)


def strew(
    shapes: Sequence[Shape],
    grid: tuple[np.ndarray, np.ndarray],
    heights: np.ndarray,
    camera: Camera,
    seen: np.ndarray,
    ranges: SceneRanges,
    random: np.random.Generator,
) -> list[Mesh]:
    """Rocks on sand of `heights` (h, w) over the nodes x, y (h, w) of a grid, metres: single ones and piles.

    They lie at some of the points `seen` (m, 2), which the camera sees. Large rocks are laid first. Each is dropped
    straight down until it touches what lies there, and then sunk by a share of its height: deep into sand, a little
    into rocks.
    """
    count = int(random.integers(ranges.rocks[0], ranges.rocks[1] + 1))
    sizes = np.sort(draw_sizes(count, ranges, random))[::-1]
    piled = random.random(count) < random.uniform(*ranges.piled_share)
    chance = _chances(seen, random.uniform(*_EVENNESS))
    piles = seen[random.choice(len(seen), max(1, round(count / _PILE_ROCKS)), p=chance)]
    top, laid = heights.copy(), []
    taken = [(camera.centre[:2], _CAMERA_ROOM_M)]
    for size, in_pile in zip(sizes.tolist(), piled.tolist(), strict=True):
        if in_pile:
            position = piles[random.integers(len(piles))] + _PILE_SPREAD * size * random.standard_normal(2)
            sunk = random.uniform(*ranges.sunk_into_rocks)
        else:
            position = _free_position(size, taken, seen[random.choice(len(seen), _TRIES, p=chance)])
            sunk = random.uniform(*ranges.sunk)
        taken.append((position, size))
        pixel_m = float(np.linalg.norm(camera.centre - [*position, 0])) / camera.lens.fx
        mesh = _fitting(shapes, size, ranges.rock_scale, random).mesh(size, _TRIANGLE_PX * pixel_m)
        points = mesh.vertices @ draw_rotation(ranges, random).as_matrix().T + np.array([*position, 0.0])
        points[:, 2] += _drop(points, grid, top) - sunk * np.ptp(points[:, 2])
        _raise(top, points, grid)
        laid.append(Mesh(points, mesh.faces))
    return laid


def draw_sizes(count: int, ranges: SceneRanges, random: np.random.Generator) -> np.ndarray:
    """(n,) metres; the number of rocks larger than d falls with a power of d between the least and the largest size.

    Power laws describe rocks at the sites where Surveyors landed (Cintala & McBride, NASA TM-104804 (1995)).
    """
    low, high = ranges.rock_size_m
    power = random.uniform(*ranges.size_power)
    share = random.random(count)
    return np.asarray((low**-power - share * (low**-power - high**-power)) ** (-1 / power))


def draw_rotation(ranges: SceneRanges, random: np.random.Generator) -> Rotation:
    """Mostly about the upright axis, with a small tilt; else about any axis."""
    if random.random() < ranges.tumbled_share:
        return Rotation.random(random_state=random)
    tilt = np.radians(ranges.tilt_sd_deg) * random.standard_normal(2)
    return Rotation.from_rotvec([*tilt, 0]) * Rotation.from_rotvec([0, 0, random.uniform(0, 2 * np.pi)])


def patches(shape: tuple[int, int], sd: float, random: np.random.Generator) -> np.ndarray:
    """(h * w,) albedo factors of the sand's vertices: wide patches and grain."""
    noise = smooth_noise(shape, 10, 10, 0, random) + random.standard_normal(shape)
    return np.clip(1 + sd * noise.ravel(), 0.3, 2)


def draw_render_options(ranges: SceneRanges, random: np.random.Generator) -> RenderOptions:
    """How one scene is rendered: reflectance, walls, light from around, lens and sensor."""
    model: Model = ranges.models[int(random.random() * len(ranges.models))]
    walled = bool(random.random() < ranges.walled_share)

    def draw(limits: Range) -> float:
        return float(random.uniform(*limits))

    return RenderOptions(
        models=(model,),
        materials={
            "default": Material(
                hapke=HapkeParameters(
                    w=draw(ranges.hapke_w),
                    b=draw(_HAPKE_B),
                    c=draw(_HAPKE_C),
                    b_s0=draw((0, 2)),
                    h_s=draw((0.03, 0.1)),
                    theta_bar_deg=draw(_HAPKE_THETA_DEG),
                ),
                principled=PrincipledParameters(roughness=draw(ranges.roughness), specular=draw(ranges.specular)),
            )
        },
        rim=walled,
        rim_albedo=draw(_WALL_ALBEDO),
        rim_height_m=draw(_WALL_HEIGHT_M),
        rim_half_width_m=_WALLED_M if walled else _OPEN_M,
        skirt_m=0,  # the rocks are closed
        ambient=draw(_AMBIENT),
        blur_px=draw(ranges.blur_px),
        lens_flare=draw(ranges.lens_flare),
        noise=ranges.noise,
        electrons_per_dn=draw(ranges.electrons_per_dn),
        min_rock_area_px=max(1, round(60 * ranges.scale**2)),
        min_shadow_area_px=max(1, round(120 * ranges.scale**2)),
        min_shadow_width_px=max(1, round(3 * ranges.scale)),
        min_part_area_px=max(1, round(20 * ranges.scale**2)),
    )


def _fitting(shapes: Sequence[Shape], size: float, scale: Range, random: np.random.Generator) -> Shape:
    """One of the shapes that may be scaled to a size; where none may, the one whose own size is nearest to it."""
    fit = [shape for shape in shapes if scale[0] * shape.size_m <= size <= scale[1] * shape.size_m]
    if not fit:
        return min(shapes, key=lambda shape: abs(np.log(shape.size_m / size)))
    return fit[random.integers(len(fit))]


def _chances(seen: np.ndarray, evenness: float) -> np.ndarray:
    """(m,) chance of each point (m, 2), from even over the picture (0) to even over the sand (1)."""
    cell = np.rint(seen / _EVEN_CELL_M).astype(int)
    _, number, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    chance = (1.0 / count[number.reshape(-1)]) ** evenness
    return np.asarray(chance / chance.sum())


def _free_position(size: float, taken: list[tuple[np.ndarray, float]], positions: np.ndarray) -> np.ndarray:
    """(2,) the first of positions (n, 2) where nothing else lies, or the one with most room."""
    room = [
        min((float(np.hypot(*(position - other))) - (size + wide) / 2 for other, wide in taken), default=np.inf)
        for position in positions
    ]
    return np.asarray(
        next((position for position, gap in zip(positions, room, strict=True) if gap > 0), positions[np.argmax(room)])
    )


def _grid_around(seen: np.ndarray, most: float, ranges: SceneRanges) -> tuple[np.ndarray, np.ndarray]:
    """X and y (h, w) of a square grid over the sand that is seen, no farther than `most` from the centre; metres."""
    low = np.maximum(seen.min(axis=0) - _MARGIN_M, -most)
    high = np.minimum(seen.max(axis=0) + _MARGIN_M, most)
    cell = max(ranges.cell_m, float((high - low).max()) / _MOST_CELLS)
    x, y = (
        first + cell * np.arange(int(np.ceil((last - first) / cell)) + 1) for first, last in zip(low, high, strict=True)
    )
    return tuple(np.meshgrid(x, y))  # type: ignore[return-value]


def _cells(points: np.ndarray, grid: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the grid x, y (h, w) that points (n, 3) lie nearest to."""
    x, y = grid
    cell = x[0, 1] - x[0, 0]
    column = np.rint((points[:, 0] - x[0, 0]) / cell).astype(int)
    row = np.rint((points[:, 1] - y[0, 0]) / cell).astype(int)
    return np.clip(row, 0, x.shape[0] - 1), np.clip(column, 0, x.shape[1] - 1)


def _drop(points: np.ndarray, grid: tuple[np.ndarray, np.ndarray], top: np.ndarray) -> float:
    """How far points (n, 3) go up until the first of them touches the surface of heights `top` (h, w)."""
    return float((top[_cells(points, grid)] - points[:, 2]).max())


def _raise(top: np.ndarray, points: np.ndarray, grid: tuple[np.ndarray, np.ndarray]) -> None:
    """Write the heights of points (n, 3) into those of what lies there."""
    np.maximum.at(top, _cells(points, grid), points[:, 2])

"""Randomised scenes: rocks of a terrain on generated sand, with random positions and materials.

Every scene has a new layout, so that a detector learns the appearance of rocks and not their positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.geometry.camera import Camera
from polarsim.geometry.heightfields import crater, gaussian_waves, grid_mesh, rough_waves, smooth_noise, sum_noise
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK
from polarsim.render.options import Model, RenderOptions
from polarsim.render.parameters import HapkeParameters, Material, PrincipledParameters
from polarsim.rocks.solids import decimate_mesh
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import level_walls
from polarsim.scenes.options import Range, SceneRanges
from polarsim.scenes.viewpoints import draw_camera

FIRST_ROCK = 1  # number of the first rock of a scene; independent of the numbers in the terrain
_TRIES = 12  # number of candidate positions of a rock; without a free one, the one with the most room is used
_MAX_HALVINGS = 6  # maximum number of halvings from the extent of a rock to the side of triangles: 24,000 triangles
_FACES_OF_WHOLE_SIDES = 6  # number of triangles of a rock if the sides were as long as the extent
_PILE_SPREAD = 0.6  # standard deviation of the position in a pile, over the size of the rock
_PILE_ROCKS = 8  # rocks of a scene per pile
_EVEN_CELL_M = 0.25  # side of the cells over which the probability of positions is divided
_CAMERA_ROOM_M = 0.8  # diameter of the area without rocks around the camera
_MARGIN_M = 0.1  # margin of sand around the visible area
_MAX_CELLS = 270  # maximum cells of the ground mesh along the longer side: the resolution of the images
_EVENNESS = (0.0, 1.0)  # from uniform over the image (0) to uniform over the sand (1)
_WALLED_M, _OPEN_M = 2.05, 3.0  # half the width of the sand with walls (that of POLAR's sandbox) and without
# Ranges (minimum, maximum) around known properties of POLAR's sandbox and of sand.
_WALL_HEIGHT_M, _WALL_ALBEDO = (0.2, 0.36), (0.2, 0.9)  # photos show heights of 0.29 to 0.36 m
_HAPKE_B, _HAPKE_C, _HAPKE_THETA_DEG = (0.15, 0.4), (-0.2, 0.6), (10, 35)  # width and balance of lobes; roughness
_AMBIENT = (0.0, 0.02)  # ambient light relative to a lamp: the hall is dark
_TRIANGLE_PX = 1.5  # maximum side of rock triangles in the image, if the scan is fine enough

# Ranges (minimum, maximum) that cover the traces of rakes, feet and sieves in a sandbox.
_FINEST_M, _WIDEST_M = 0.008, 0.4  # sizes of roughness: limited by the mesh below and by swells above
_RIDGE_LENGTH_M, _RIDGE_WIDTH_M = (0.015, 0.12), (0.01, 0.03)  # correlation lengths along and across a ridge
_RIDGE_SD_M = (0.0003, 0.002)
_CRATER_RADIUS_M = (0.1, 1.1)  # at the crest
_CRATER_DEPTH = (0.1, 0.3)  # over the radius: from worn craters to fresh ones


@dataclass(frozen=True)
class RandomScene:
    """A random scene: mesh, albedo factors of the vertices (v,), camera and render options."""

    mesh: TerrainMesh
    albedo: np.ndarray
    camera: Camera
    options: RenderOptions


class RockShape:
    """Rock shape, centred at the origin, with longest extent 1. Simplified copies are cached."""

    def __init__(self, mesh: Mesh) -> None:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        self.size_m = float((high - low).max())
        self._copies: dict[int, Mesh] = {}
        self._original = Mesh((mesh.vertices - (low + high) / 2) / self.size_m, mesh.faces)

    def mesh(self, size_m: float, side_m: float) -> Mesh:
        """Return the rock with a given size and triangle sides of at most about `side_m`, metres, if fine enough.

        The triangle sides of copies are 1/4, 1/8 ... 1/64 of the longest extent.
        """
        halvings = int(np.clip(np.ceil(np.log2(size_m / side_m)), 2, _MAX_HALVINGS))
        copy = self._copy(halvings)
        return Mesh(size_m * copy.vertices, copy.faces)

    def _copy(self, halvings: int) -> Mesh:
        """Return the copy simplified from the next finer copy, which is faster than from the original."""
        if halvings not in self._copies:
            finer = self._original if halvings == _MAX_HALVINGS else self._copy(halvings + 1)
            faces = _FACES_OF_WHOLE_SIDES * 4**halvings
            self._copies[halvings] = decimate_mesh(finer, faces / len(finer.faces))
        return self._copies[halvings]


def draw_scene(shapes: Sequence[RockShape], ranges: SceneRanges, random: np.random.Generator) -> RandomScene:
    """Return a random scene of rocks with the given shapes."""
    options, wall_height = draw_render_options(ranges, random)
    half = _WALLED_M if options.walls else _OPEN_M
    camera, visible = draw_camera(half, wall_height if options.walls else 0.0, ranges, random)
    grid = _grid_around(visible, half, ranges)
    relief = draw_relief(*grid, ranges, random)
    ground = grid_mesh(*grid, relief)
    vertices, faces, rock_of_face = [ground.vertices], [ground.faces], [np.full(len(ground.faces), NO_ROCK)]
    albedo = [patches(relief.shape, random.uniform(*ranges.patch_sd), random)]
    count = len(ground.vertices)
    rocks_albedo = random.uniform(*ranges.rock_albedo)
    for number, mesh in enumerate(scatter_rocks(shapes, grid, relief, camera, visible, ranges, random), FIRST_ROCK):
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + count)
        rock_of_face.append(np.full(len(mesh.faces), number))
        rock_albedo = rocks_albedo * max(0.3, 1 + ranges.rock_spread * random.standard_normal())
        albedo.append(np.full(len(mesh.vertices), rock_albedo, np.float32))
        count += len(mesh.vertices)
    terrain_mesh = TerrainMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(rock_of_face))
    terrain_mesh = replace(terrain_mesh, walls=level_walls(half, terrain_mesh.sand_level + wall_height))
    return RandomScene(terrain_mesh, np.concatenate(albedo).astype(np.float32), camera, options)


def draw_relief(x: np.ndarray, y: np.ndarray, ranges: SceneRanges, random: np.random.Generator) -> np.ndarray:
    """Return random heights (h, w) at the nodes (h, w) of a square grid with rows along y, metres."""
    cell = float(x[0, 1] - x[0, 0])
    layers = []
    for _ in range(random.integers(ranges.max_layers + 1)):
        along, across, sd = (random.uniform(*limits) for limits in (_RIDGE_LENGTH_M, _RIDGE_WIDTH_M, _RIDGE_SD_M))
        angle = random.uniform(0, np.pi)
        layers.append((sd, gaussian_waves(x.shape, along / cell, across / cell, angle)))
    width = ranges.swell_width_m / cell
    layers.append((random.uniform(*ranges.swell_sd_m), gaussian_waves(x.shape, width, width, 0)))
    rough = random.uniform(*ranges.rough_sd_m)
    layers.append((rough, rough_waves(x.shape, _FINEST_M / cell, _WIDEST_M / cell)))
    height = sum_noise(x.shape, layers, random)
    for _ in range(random.integers(ranges.max_craters + 1)):
        radius, share = random.uniform(*_CRATER_RADIUS_M), random.uniform(*_CRATER_DEPTH)
        centre = random.uniform(0.8 * np.array([x.min(), y.min()]), 0.8 * np.array([x.max(), y.max()]))
        height += crater(x - centre[0], y - centre[1], radius, share * radius)
    return height


def scatter_rocks(
    shapes: Sequence[RockShape],
    grid: tuple[np.ndarray, np.ndarray],
    heights: np.ndarray,
    camera: Camera,
    visible: np.ndarray,
    ranges: SceneRanges,
    random: np.random.Generator,
) -> list[Mesh]:
    """Place single rocks and piles on sand with `heights` (h, w) at the grid nodes x, y (h, w), metres.

    Positions are chosen from the points `visible` (m, 2) in the view of the camera. Large rocks are placed first. Each
    rock is dropped until it touches sand or a rock and then lowered by a share of its height: a large share in sand, a
    small share on rocks.
    """
    count = int(random.integers(ranges.rocks[0], ranges.rocks[1] + 1))
    sizes = np.sort(draw_sizes(count, ranges, random))[::-1]
    piled = random.random(count) < random.uniform(*ranges.piled_share)
    probability = _probabilities(visible, random.uniform(*_EVENNESS))
    piles = visible[random.choice(len(visible), max(1, round(count / _PILE_ROCKS)), p=probability)]
    top, rocks = heights.copy(), []
    occupied = [(camera.centre[:2], _CAMERA_ROOM_M)]
    for size, in_pile in zip(sizes.tolist(), piled.tolist(), strict=True):
        if in_pile:
            position = piles[random.integers(len(piles))] + _PILE_SPREAD * size * random.standard_normal(2)
            sunk = random.uniform(*ranges.sunk_into_rocks)
        else:
            candidates = visible[random.choice(len(visible), _TRIES, p=probability)]
            position = _free_position(size, occupied, candidates)
            sunk = random.uniform(*ranges.sunk)
        occupied.append((position, size))
        pixel_m = float(np.linalg.norm(camera.centre - [*position, 0])) / camera.lens.fx
        mesh = _choose_shape(shapes, size, ranges.rock_scale, random).mesh(size, _TRIANGLE_PX * pixel_m)
        rotation = draw_rotation(ranges.tumbled_share, ranges.tilt_sd_deg, random).as_matrix()
        points = mesh.vertices @ rotation.T + np.array([*position, 0.0])
        drop_rock(points, top, _cells(points, grid), sunk)
        rocks.append(Mesh(points, mesh.faces))
    return rocks


def drop_rock(points: np.ndarray, top: np.ndarray, cells: tuple[np.ndarray, np.ndarray], sunk: float) -> None:
    """Drop the points (n, 3) of a rock until the first one touches, then lower them by a share of the height.

    `top` (rows, columns), heights of ground and rocks at the nodes of a grid, is raised to the rock; `cells`: rows (n,)
    and columns (n,) of the nodes below the points. Both arrays are changed in place; metres.
    """
    points[:, 2] += (top[cells] - points[:, 2]).max() - sunk * np.ptp(points[:, 2])
    np.maximum.at(top, cells, points[:, 2])


def draw_sizes(count: int, ranges: SceneRanges, random: np.random.Generator) -> np.ndarray:
    """Return random sizes (n,), metres, from a power law between the minimum and the maximum size.

    Power laws describe the rocks at the Surveyor landing sites (Cintala & McBride, NASA TM-104804 (1995)).
    """
    return power_law(count, ranges.rock_size_m, random.uniform(*ranges.size_power), random)


def power_law(count: int, limits: Range, power: float, random: np.random.Generator) -> np.ndarray:
    """Return random sizes (n,) between the limits; the number of larger sizes falls with the exponent `power`."""
    low, high = limits
    share = random.random(count)
    return np.asarray((low**-power - share * (low**-power - high**-power)) ** (-1 / power))


def draw_rotation(tumbled_share: float, tilt_sd_deg: float, random: np.random.Generator) -> Rotation:
    """Return a random rotation: of a share of rocks about any axis, else about the vertical with a small tilt."""
    if random.random() < tumbled_share:
        return Rotation.random(random_state=random)
    tilt = np.radians(tilt_sd_deg) * random.standard_normal(2)
    return Rotation.from_rotvec([*tilt, 0]) * Rotation.from_rotvec([0, 0, random.uniform(0, 2 * np.pi)])


def patches(shape: tuple[int, int], sd: float, random: np.random.Generator) -> np.ndarray:
    """Return random albedo factors (h * w,) of the sand vertices: wide patches and grain."""
    noise = smooth_noise(shape, 10, 10, 0, random) + random.standard_normal(shape)
    return np.clip(1 + sd * noise.ravel(), 0.3, 2)


def draw_render_options(ranges: SceneRanges, random: np.random.Generator) -> tuple[RenderOptions, float]:
    """Return random render options of a scene, and the height of the walls above the sand, metres."""
    model: Model = ranges.models[int(random.random() * len(ranges.models))]
    walled = bool(random.random() < ranges.walled_share)

    def draw(limits: Range) -> float:
        return float(random.uniform(*limits))

    material = Material(
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
    wall_albedo, wall_height = draw(_WALL_ALBEDO), draw(_WALL_HEIGHT_M)
    options = RenderOptions(
        models=(model,),
        materials={"default": material},
        walls=walled,
        wall_albedo=wall_albedo,
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
    return options, wall_height


def _choose_shape(shapes: Sequence[RockShape], size: float, scale: Range, random: np.random.Generator) -> RockShape:
    """Return a random shape that may be scaled to a size; without such a shape, the shape with the closest size."""
    fit = [shape for shape in shapes if scale[0] * shape.size_m <= size <= scale[1] * shape.size_m]
    if not fit:
        return min(shapes, key=lambda shape: abs(np.log(shape.size_m / size)))
    return fit[random.integers(len(fit))]


def _probabilities(points: np.ndarray, evenness: float) -> np.ndarray:
    """Return the probability (m,) of points (m, 2), from uniform over the image (0) to uniform over the sand (1)."""
    cell = np.rint(points / _EVEN_CELL_M).astype(int)
    _, number, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    weight = (1.0 / count[number.reshape(-1)]) ** evenness
    return np.asarray(weight / weight.sum())


def _free_position(size: float, occupied: list[tuple[np.ndarray, float]], positions: np.ndarray) -> np.ndarray:
    """Return the first free position (2,) of candidates (n, 2), or the candidate with the most room."""
    room = [
        min((float(np.hypot(*(position - other))) - (size + wide) / 2 for other, wide in occupied), default=np.inf)
        for position in positions
    ]
    return np.asarray(
        next((position for position, gap in zip(positions, room, strict=True) if gap > 0), positions[np.argmax(room)])
    )


def _grid_around(points: np.ndarray, half_width: float, ranges: SceneRanges) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (h, w) of a square grid around points (n, 2), clipped to the half width of the sand; metres."""
    low = np.maximum(points.min(axis=0) - _MARGIN_M, -half_width)
    high = np.minimum(points.max(axis=0) + _MARGIN_M, half_width)
    cell = max(ranges.cell_m, float((high - low).max()) / _MAX_CELLS)
    x, y = (
        first + cell * np.arange(int(np.ceil((last - first) / cell)) + 1) for first, last in zip(low, high, strict=True)
    )
    return tuple(np.meshgrid(x, y))  # type: ignore[return-value]


def _cells(points: np.ndarray, grid: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and columns of the grid nodes x, y (h, w) nearest to points (n, 3)."""
    x, y = grid
    cell = x[0, 1] - x[0, 0]
    column = np.rint((points[:, 0] - x[0, 0]) / cell).astype(int)
    row = np.rint((points[:, 1] - y[0, 0]) / cell).astype(int)
    return np.clip(row, 0, x.shape[0] - 1), np.clip(column, 0, x.shape[1] - 1)

"""Ground of scenes beyond the sandbox: relief, bedrock, tracks and hills at the nodes of a view."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from polarsim.geometry.heightfields import crater
from polarsim.scenes.field_options import TARGET_M, FieldRanges, GroundKind, log_uniform
from polarsim.scenes.field_view import HILLS, FieldView

_LATTICE = 64  # nodes of the periodic lattice of an octave
_MAX_SLABS = 4000


def draw_ground(
    view: FieldView, kind: GroundKind, ranges: FieldRanges, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (rows, columns), metres, and albedo factors (rows, columns) of the nodes of a view."""
    x, y = view.nodes
    width = view.width
    limit = 0.25 * view.height  # of heights, so that the camera is above the ground
    hurst = random.uniform(*ranges.hurst)
    sd = min(log_uniform(ranges.rough, random) * width, limit / 3)
    heights = sd * octaves(x, y, view.cell, width, hurst, random)
    albedo = 1 + random.uniform(*ranges.patch_sd) * octaves(x, y, view.cell, width, 0.3, random)
    if kind == "ripples":
        heights = heights + _ripples(view, random)
    elif kind == "craters":
        heights = _with_craters(view, heights, limit, random)
    elif kind in ("bedrock", "outcrop"):
        heights, albedo = _with_bedrock(view, heights, albedo, sd, limit, kind, random)
    elif kind == "ledges":
        heights, albedo = _with_ledges(view, heights, albedo, limit, random)
    if random.random() < ranges.tracks_share:
        heights, albedo = _with_tracks(view, heights, albedo, width, random)
    foot = view.cells_of(np.array([[max(view.forward[0], 0.0), 0.0]]))
    heights = np.minimum(heights - heights[foot], np.maximum(limit, 0.1 * (x - view.forward[0])))
    return heights + _hills(x, y, random.uniform(*ranges.hills), random), np.clip(albedo, 0.3, 2.5)


def _ripples(view: FieldView, random: np.random.Generator) -> np.ndarray:
    """Return heights (rows, columns) of ripples by wind, which fade out where they are finer than the cells, metres."""
    x, y = view.nodes
    length, angle = random.uniform(0.03, 0.2) * view.width, random.uniform(0, np.pi)
    phase = 2 * np.pi * (np.cos(angle) * x + np.sin(angle) * y) / length
    phase = phase + random.uniform(0.3, 2) * octaves(x, y, view.cell, 5 * length, 1.0, random)
    shown = np.clip(length / (4 * view.cell) - 0.5, 0, 1)
    return np.asarray(random.uniform(0.02, 0.06) * length * np.sin(phase + 0.6 * np.sin(phase)) * shown)


def _with_craters(view: FieldView, heights: np.ndarray, limit: float, random: np.random.Generator) -> np.ndarray:
    """Return heights (rows, columns) with craters of many sizes, at most `limit` deep, metres."""
    x, y = view.nodes
    for radius in view.width * 0.02 * random.uniform(0.02, 1, random.integers(3, 25)) ** -0.6:
        depth = min(random.uniform(0.1, 0.4) * radius, limit)
        centre = view.draw_points(1, 0.3, random)[0]
        heights = heights + crater(x - centre[0], y - centre[1], radius, depth)
    return heights


def _with_bedrock(
    view: FieldView,
    heights: np.ndarray,
    albedo: np.ndarray,
    sd: float,
    limit: float,
    kind: Literal["bedrock", "outcrop"],
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights and albedo (rows, columns) with tilted plates that are partly covered by sand.

    `sd`: standard deviation of the heights of the sand; `limit`: twice the maximum height of plates, metres. Sand
    covers an outcrop except for some areas.
    """
    x, y = view.nodes
    size = random.uniform(0.08, 0.5) * view.width
    slab, gap = _slabs(x, y, size, random)
    slab = slab * min(random.uniform(0.01, 0.06) * size, limit / 2)
    slab = slab * np.clip(size / (2 * view.cell) - 1, 0, 1)  # coarse cells would show plates as steps
    slab = slab + 0.3 * sd * octaves(x, y, view.cell, size, 0.6, random)
    slab = slab - random.uniform(0.02, 0.12) * size * np.exp(-((gap / random.uniform(0.04, 0.15)) ** 2))
    level = np.quantile(slab, random.uniform(0.02, 0.5 if kind == "bedrock" else 0.3))
    sand = level + 0.5 * heights
    if kind == "outcrop":
        sand = sand + np.maximum(octaves(x, y, view.cell, 2 * view.width, 1.0, random) + 0.4, -0.2) * 0.3 * size
    ratio = log_uniform((0.5, 1.8), random)
    return np.maximum(slab, sand), np.where(slab > sand, ratio, 1.0) * albedo


def _with_ledges(
    view: FieldView, heights: np.ndarray, albedo: np.ndarray, limit: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (rows, columns), at most `limit`, metres, and albedo of layered rock that erodes to steps."""
    x, y = view.nodes
    drop = random.uniform(0.02, 0.1) * view.width
    layers = heights + 2 * drop * octaves(x, y, view.cell, 2 * view.width, 1.0, random)
    layers = layers + 0.3 * x * np.tan(np.radians(random.uniform(-8, 8)))
    step = layers / drop
    part = step - np.floor(step)
    heights = drop * (np.floor(step) + np.clip((part - 0.75) / 0.25, 0, 1)) + 0.4 * heights
    return np.clip(heights, -4 * limit, limit), albedo * np.exp(0.2 * np.sin(2.4 * np.floor(step)))


def octaves(
    x: np.ndarray, y: np.ndarray, cell: np.ndarray, widest: float, hurst: float, random: np.random.Generator
) -> np.ndarray:
    """Return noise (rows, columns) with structure of every size from `widest` to the cells, sd of about 1.

    Octaves are cubic B-splines as in `heightfields.octave_relief`, on periodic lattices, for nodes that are not on a
    rectangular grid. Octaves fade out where they are finer than two cells.
    """
    total, energy = np.zeros(np.shape(y)), 0.0
    length, finest = widest, 2 * float(cell.min())
    while length > finest:
        amplitude = (length / widest) ** hurst
        lattice = random.standard_normal((_LATTICE, _LATTICE))
        angle, (dx, dy) = random.uniform(0, 2 * np.pi), random.uniform(0, _LATTICE, 2)
        u = (np.cos(angle) * x + np.sin(angle) * y) / length + dx
        v = (np.cos(angle) * y - np.sin(angle) * x) / length + dy
        spline = ndimage.map_coordinates(lattice, [v, u], order=3, prefilter=False, mode="grid-wrap")
        total += amplitude * np.clip(length / (2 * cell) - 1, 0, 1) * spline
        energy += (0.46 * amplitude) ** 2  # variance of a cubic B-spline of normal numbers, mean over the lattice
        length /= 2
    return np.asarray(total / np.sqrt(max(energy, 1e-12)))


def _slabs(x: np.ndarray, y: np.ndarray, size: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (rows, columns) of tilted plates, about -1 to 1, and the distance from their edges over `size`."""
    near = x < 12 * TARGET_M
    low, high = (np.array([extreme(x[near]), extreme(y[near])]) for extreme in (np.min, np.max))
    size = max(size, float(np.sqrt(np.prod(high - low) / _MAX_SLABS)))
    stretch = np.array([1.0, random.uniform(0.4, 1.0)])
    count = np.maximum(np.ceil((high - low) / (size * stretch)), 1).astype(int)
    rows, columns = np.meshgrid(*(np.arange(number) for number in count), indexing="ij")
    seeds = np.stack([rows, columns], axis=-1).reshape(-1, 2) + random.uniform(0.05, 0.95, (rows.size, 2))
    places = (np.stack([x, y], axis=-1).reshape(-1, 2) - low) / (size * stretch)
    distance, number = map(np.asarray, cKDTree(seeds).query(places, k=2))
    nearest, offset = number[:, 0], places - seeds[number[:, 0]]
    level, tilt = random.uniform(-1, 1, len(seeds)), 0.8 * random.standard_normal((len(seeds), 2))
    heights = level[nearest] + (np.clip(offset, -1, 1) * tilt[nearest]).sum(axis=1)
    return heights.reshape(x.shape), (distance[:, 1] - distance[:, 0]).reshape(x.shape)


def _with_tracks(
    view: FieldView, heights: np.ndarray, albedo: np.ndarray, width: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights and albedo with two parallel wheel tracks with the traces of grousers."""
    x, y = view.nodes
    wheel, angle = random.uniform(0.06, 0.3) * width, random.uniform(0, np.pi)
    centre, bend = view.draw_points(1, 0.2, random)[0], random.uniform(-0.1, 0.1) / width
    along = np.cos(angle) * (x - centre[0]) + np.sin(angle) * (y - centre[1])
    across = np.cos(angle) * (y - centre[1]) - np.sin(angle) * (x - centre[0]) + bend * along**2
    apart = random.uniform(2, 5) * wheel
    beside = np.minimum(np.abs(across), np.abs(across - apart)) / wheel  # distance from the middle of a track
    rut = 1 / (1 + np.exp(np.clip((beside - 0.5) / 0.06, -40, 40)))
    depth, pitch = random.uniform(0.03, 0.15) * wheel, random.uniform(0.15, 0.5) * wheel
    shown = np.clip(pitch / (3 * view.cell) - 0.5, 0, 1)
    lugs = np.tanh(3 * np.sin(2 * np.pi * along / pitch)) * shown
    rim = 0.4 * np.exp(-(((beside - 0.62) / 0.1) ** 2))
    heights = heights * (1 - 0.7 * rut) + depth * (rim - rut * (1 - 0.4 * lugs))
    return heights, albedo * (1 + random.uniform(-0.35, 0.2) * rut)


def _hills(x: np.ndarray, y: np.ndarray, slope: float, random: np.random.Generator) -> np.ndarray:
    """Return heights (rows, columns) of ridges behind the rocks, with an elevation of tangent `slope` or less."""
    if x[-1, 0] < HILLS * TARGET_M:
        return np.zeros(x.shape)
    ridge = octaves(x, y, np.full((1, 1), 10.0), 100 * TARGET_M, 0.9, random)
    rise = np.clip((x / TARGET_M - 30) / 150, 0, 1)
    return np.asarray(slope * x * rise * np.clip(0.5 + 0.4 * ridge, 0, 1.5))

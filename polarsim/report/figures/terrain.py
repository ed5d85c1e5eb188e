"""Figures of a terrain's meshes and rock cuboids: height map from above, oblique view under a Sun lamp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import obj
from polarsim.formats.tables import read_parquet
from polarsim.geometry.casters import make_caster
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.rays import Caster
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.report.figures.canvas import (
    FAINT,
    FIGURE_WIDTH,
    INK,
    LETTER_M,
    SERIES,
    name_positions,
    note,
    page,
    rectangle,
    show_image,
)
from polarsim.run_files.scene import FITTED, PHOTOS, PUBLISHED, SCANNED, TerrainMesh, mesh_origins, read_terrain
from polarsim.site import Site
from polarsim.site_parts import Sandbox

CUBOID_COLUMNS = ("rock", "x0", "y0", "z0", "x1", "y1", "z1", "size_m", "height_m")
GROUND_COLOURS = "viridis"
RELIEF = 0.65  # strength of the hill shading, 0 to 1
STEP = 0.0075  # ray spacing of the view from above, metres
SKY = 3.0  # start height of these rays, metres
OUTLINE = "#d55e00"
SPAN = 0.15  # minimum range of the colour scale, metres, so that flat sand has a uniform colour
_MIN_HALF_M = 2.0  # half width of the maps of smaller sandboxes
# Oblique view of a sandbox of this half width: camera centre on the side +X, and downward pitch.
_EYE_M, _PITCH_DEG = (3.9, -0.2, 2.3), 32.0
_NEAR_TRIPOD_M = 1.0  # maximum distance of a tripod that names an oblique view
AMBIENT = 0.12  # share of ambient light in the oblique view
HEIGHTS = {  # label of the colour bar by source of the ground mesh
    SCANNED: "height above the sand level, m",
    PUBLISHED: "height in the frame of the published ground, m",
    FITTED: "height above a smooth ground fitted to the rocks' feet, m",
    PHOTOS: "height of the ground measured in photos, m",
}
Box = tuple[float, float, float, float]  # x0, y0, x1, y1, y upwards
SAND, STONE = np.array([0.78, 0.74, 0.68]), np.array([0.93, 0.62, 0.25])


@dataclass(frozen=True)
class TopView:
    """A terrain from above; pixel size `STEP`, row 0 at the largest y."""

    height: np.ndarray  # (h, w) metres, NaN without surface
    rock: np.ndarray  # (h, w) rock id or NO_ROCK
    extent: tuple[float, float, float, float]  # x from, x to, y from, y to


def draw_terrain(
    *,
    site: Site,
    terrain: Terrain,
    rocks: Path,
    meshes: Path,
    meshes_figure: Path,
    crops_figure: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write two figures: the meshes from above and in an oblique view, and the cuboids of the rocks."""
    table = read_parquet(rocks, CUBOID_COLUMNS)
    sandbox = site.sandbox_of(terrain)
    scene = read_terrain(meshes, terrain, sandbox)
    rays = make_caster(scene.vertices, scene.faces)
    top, view = top_view(scene, rays, sandbox), oblique(site, terrain)
    heights = HEIGHTS.get(mesh_origins(meshes).get(obj.ground_name(terrain), ""), HEIGHTS[SCANNED])
    name = f"Terrain {terrain_text(terrain)}"
    with page(meshes_figure, width, round(width * 0.51)) as sheet:
        _draw_meshes(sheet, name, scene, rays, top, view, width, heights)
    with page(crops_figure, width, round(width * 0.5)) as sheet:
        _draw_crops(sheet, name, table, top, heights)


def _draw_meshes(
    sheet: Any, name: str, scene: TerrainMesh, rays: Caster, top: TopView, view: Oblique, width: int, heights: str
) -> None:
    """Draw the meshes from above with rock outlines and ids, and in an oblique view."""
    above, oblique = sheet.subplots(1, 2, width_ratios=[1, 1.5])
    _draw_top(sheet, above, top, f"{name} from above, {len(scene.rocks)} rocks", heights)
    for rock in scene.rocks:
        _draw_outline(above, top, rock)
    _write_ids(above, {str(rock): _box(top, rock, scene) for rock in scene.rocks}, LETTER_M)
    pixels = _without_margin(oblique_view(scene, rays, view, round(width * 0.6)))
    show_image(oblique, pixels, f"{view.title}; rocks are tinted")


def _without_margin(pixels: np.ndarray) -> np.ndarray:
    """Return the rows of an image (h, w, 3) that are not white."""
    rows = np.flatnonzero((pixels < 255).any(axis=(1, 2)))
    return pixels[rows[0] : rows[-1] + 1] if len(rows) else pixels


def _draw_crops(sheet: Any, name: str, table: pd.DataFrame, top: TopView, heights: str) -> None:
    """Draw the cuboids on the view from above, and the size and the range of heights of each rock."""
    panels = sheet.subplot_mosaic([["above", "size"], ["above", "heights"]], width_ratios=[1.05, 1])
    _draw_top(sheet, panels["above"], top, f"{name}: cuboids of {len(table)} rocks from above", heights)
    _draw_rectangles(panels["above"], table)
    rows = table.sort_values(["size_m", "rock"], ascending=[False, True])
    bars = {
        "size": ("Largest extent of each rock", "extent, m", np.zeros(len(rows)), rows["size_m"].to_numpy(float)),
        "heights": ("Lowest to highest point of each cuboid", "z, m", *rows[["z0", "z1"]].to_numpy(float).T),
    }
    small = max(5.0, min(11.0, 300 / max(1, len(rows))))  # points, so that all ids fit
    for panel, (title, unit, low, high) in bars.items():
        axes = panels[panel]
        axes.set_title(title)
        axes.bar(np.arange(len(rows)), high - low, 0.7, low, color=SERIES[0])
        axes.axhline(0, color=FAINT, linewidth=0.8)
        axes.set_xticks(np.arange(len(rows)), rows["rock"].astype(str), rotation=90, fontsize=small)
        axes.set_ylabel(unit)
        axes.margins(x=0.01)
        axes.grid(visible=True, axis="y")
        if not len(rows):
            axes.text(0.5, 0.55, "no rocks", transform=axes.transAxes, ha="center")
            axes.set_yticks([])
    panels["heights"].set_xlabel("rock id, largest rock first")


def map_half_m(sandbox: Sandbox) -> np.ndarray:
    """Return the half widths (2,) of the maps of a sandbox, metres; maps of small boxes show the floor around them."""
    half = np.array(sandbox.half_width_m)
    return half if half.max() >= _MIN_HALF_M else np.full(2, _MIN_HALF_M)


def top_view(scene: TerrainMesh, rays: Caster, sandbox: Sandbox) -> TopView:
    """Cast vertical rays onto the terrain."""
    half = map_half_m(sandbox)
    low = np.maximum(scene.vertices[:, :2].min(axis=0), -half - 0.3)
    high = np.minimum(scene.vertices[:, :2].max(axis=0), half + 0.3)
    x = np.arange(low[0] + STEP / 2, high[0], STEP)
    y = np.arange(low[1] + STEP / 2, high[1], STEP)[::-1]
    across, along = np.meshgrid(x, y)
    origins = np.stack([across, along, np.full_like(across, SKY)], axis=-1).reshape(-1, 3)
    distance, face = rays.nearest(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
    height = np.where(np.isfinite(distance), SKY - distance, np.nan)
    rock = np.where(face >= 0, scene.rock_of_face[face], NO_ROCK)
    extent = (float(low[0]), float(high[0]), float(low[1]), float(high[1]))
    return TopView(height.reshape(across.shape), rock.reshape(across.shape), extent)


@dataclass(frozen=True)
class Oblique:
    """Camera pose and lamp (3,) of an oblique view, sandbox frame, metres, with a title."""

    sandbox_from_camera: Pose
    lamp: np.ndarray
    title: str


def oblique(site: Site, terrain: Terrain) -> Oblique:
    """Return the view along the longer side of the sandbox, from +X if both are equal, under the first lamp."""
    half_x, half_y = site.sandbox_of(terrain).half_width_m
    scale, along_y = max(1.0, half_x / _MIN_HALF_M, half_y / _MIN_HALF_M), half_y > half_x
    pose = camera_pose(scale * np.array(_EYE_M), np.pi, np.radians(_PITCH_DEG))
    if along_y:  # turned by 90 degrees about z
        pose = camera_pose(scale * np.array([-_EYE_M[1], _EYE_M[0], _EYE_M[2]]), -np.pi / 2, np.radians(_PITCH_DEG))
    near = [
        position
        for position, tripod in site.tripods_of(terrain).items()
        if np.linalg.norm(np.array(tripod.camera_m) - pose.translation) < _NEAR_TRIPOD_M
    ]
    seen_from = f"tripod {near[0]}" if near else "+Y" if along_y else "+X"
    azimuth, lamp = next(iter(site.lamps.items()), (None, None))
    if lamp is None:
        return Oblique(pose, pose.translation + np.array([0.0, 0.0, 1.0]), f"View from {seen_from}")
    return Oblique(pose, np.array(lamp.point), f"View from {seen_from}, lamp at Sun azimuth {azimuth}")


def oblique_view(scene: TerrainMesh, rays: Caster, view: Oblique, width: int) -> np.ndarray:
    """Return an oblique image (h, width, 3): diffuse light of one lamp, cast shadows, tinted rocks."""
    height = round(0.62 * width)
    lens = Lens(1.02 * width, 1.02 * width, width / 2, height / 2, width=width, height=height)
    directions = view.sandbox_from_camera.rotate(lens.pixel_directions().reshape(-1, 3))
    origins = np.broadcast_to(view.sandbox_from_camera.translation, directions.shape)
    distance, face = rays.nearest(origins, directions)
    hit = np.flatnonzero(face >= 0)
    points = origins[hit] + distance[hit, None] * directions[hit]
    to_lamp = (view.lamp + np.array([0.0, 0.0, scene.sand_level])) - points
    flat, smooth = _normals(scene, face[hit], points)
    lit = ~rays.occluded(points + 1e-3 * flat, to_lamp, 1.0)
    towards = to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    shade = AMBIENT * (0.6 + 0.4 * smooth[:, 2]) + lit * np.einsum("nk,nk->n", smooth, towards).clip(0) * 1.6
    colour = np.where((scene.rock_of_face[face[hit]] == NO_ROCK)[:, None], SAND, STONE)
    pixels = np.ones((height * width, 3))
    pixels[hit] = (colour * shade[:, None]).clip(0, 1) ** (1 / 2.2)
    return np.round(255 * pixels.reshape(height, width, 3)).astype(np.uint8)


def _normals(scene: TerrainMesh, face: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit face normals (n, 3), and vertex normals (n, 3) interpolated at points (n, 3) on the faces."""
    a, b, c = (scene.vertices[scene.faces[face, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("nk,nk->n", normal, normal), 1e-30)
    v = np.einsum("nk,nk->n", np.cross(points - a, c - a), normal) / squared
    w = np.einsum("nk,nk->n", np.cross(b - a, points - a), normal) / squared
    weights = np.stack([1 - v - w, v, w], axis=1).clip(0)
    smooth = np.einsum("nj,njk->nk", weights, scene.normals[scene.faces[face]])
    return normal / np.sqrt(squared)[:, None], smooth / np.linalg.norm(smooth, axis=1, keepdims=True).clip(1e-9)


def _draw_top(sheet: Any, axes: Any, top: TopView, title: str, heights: str) -> None:
    """Draw the ground's height with hill shading from azimuth 135, and tinted rocks.

    `heights` is the label of the colour bar.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LightSource, Normalize
    from matplotlib.ticker import MaxNLocator

    axes.set_title(title)
    axes.set(xlabel="x (Sun azimuth 0), m", ylabel="y (Sun azimuth 90), m")
    axes.set_aspect("equal", anchor="N")
    if not np.isfinite(top.height).any():
        note(sheet, "no surface")
        return
    ground = top.height[np.isfinite(top.height) & (top.rock == NO_ROCK)]
    low, high = np.percentile(ground if len(ground) else top.height[np.isfinite(top.height)], [0.5, 99.5])
    low, high = min(low, (low + high - SPAN) / 2), max(high, (low + high + SPAN) / 2)
    filled = np.where(np.isfinite(top.height), top.height, low)
    light = LightSource(azdeg=315, altdeg=35).hillshade(filled, vert_exag=2, dx=STEP, dy=STEP)
    scale = ScalarMappable(Normalize(low, high), GROUND_COLOURS)
    colours = scale.to_rgba(top.height)[..., :3]
    colours[top.rock != NO_ROCK] = STONE
    shade = 1 + RELIEF * (2 * light - 1)
    shown = np.where(np.isfinite(top.height)[..., None], (colours * shade[..., None]).clip(0, 1), 1)
    axes.imshow(shown, extent=top.extent)
    sheet.colorbar(scale, ax=axes, label=heights, location="bottom", shrink=0.9, aspect=35, ticks=MaxNLocator(5))


def _draw_outline(axes: Any, top: TopView, rock: int) -> None:
    """Draw the outline of a rock from above, unless other rocks cover it."""
    shown = np.argwhere(top.rock == rock)
    if len(shown):
        (row0, column0), (row1, column1) = np.maximum(shown.min(axis=0) - 2, 0), shown.max(axis=0) + 3
        part = slice(row0, row1), slice(column0, column1)
        inside = (top.rock[part] == rock).astype(float)
        if min(inside.shape) > 1:
            axes.contour(_columns(top)[part[1]], _rows(top)[part[0]], inside, levels=[0.5], colors=[OUTLINE])


def _draw_rectangles(axes: Any, table: pd.DataFrame) -> None:
    """Draw the cuboids from above with rock ids."""
    rows = table[["rock", "x0", "y0", "x1", "y1"]].itertuples(index=False)
    boxes = {str(int(rock)): (float(x0), float(y0), float(x1), float(y1)) for rock, x0, y0, x1, y1 in rows}
    for box in boxes.values():
        rectangle(axes, box, OUTLINE, linewidth=1.3)
    _write_ids(axes, boxes, LETTER_M)


def _write_ids(axes: Any, boxes: Mapping[str, Box], letter: tuple[float, float]) -> None:
    """Write the rock ids next to the boxes with minimum overlap."""
    from matplotlib.patheffects import withStroke

    white = [withStroke(linewidth=3, foreground="white")]
    for rock, (x, y) in name_positions(boxes, letter).items():
        axes.text(x, y, rock, ha="center", va="center", color=INK, path_effects=white)


def _box(top: TopView, rock: int, scene: TerrainMesh) -> Box:
    """Return the bounding box of the visible part of a rock on the map, or of the mesh if other rocks cover it."""
    shown = np.argwhere(top.rock == rock)
    if len(shown):
        x, y = _columns(top)[shown[:, 1]], _rows(top)[shown[:, 0]]
    else:
        x, y = scene.rock_vertices(rock)[:, :2].T
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def _columns(top: TopView) -> np.ndarray:
    return top.extent[0] + STEP * (np.arange(top.height.shape[1]) + 0.5)


def _rows(top: TopView) -> np.ndarray:
    return top.extent[2] + STEP * (np.arange(top.height.shape[0])[::-1] + 0.5)

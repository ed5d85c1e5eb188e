"""Comparison of reconstructed and true meshes: samples of the visible parts with the distance to the other surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import nasa
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import rectified_left
from polarsim.photo import NO_ROCK, Terrain
from polarsim.randomness import generator
from polarsim.run_files.inventory import Inventory, read_inventory
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.scoring.alignment import read_alignment, refine_alignment
from polarsim.scoring.surface import Surface
from polarsim.site_parts import Sandbox

SEED = 0  # of the samples on surfaces
SURFACE_SAMPLES = 20_000  # points on all rocks, and on the ground
EDGE = 0.1  # metres; width of the excluded strip along the walls
REACH_PX = 3  # search radius for the range of a point: range maps are registered to 1 or 2 px
SAME_RANGE = 0.015  # metres; maximum difference between the distance of a point and a range


@dataclass(frozen=True)
class TrueView:
    """View of the true scene from a position."""

    camera: Camera  # rectified, in the frame of the ground truth
    ranges: np.ndarray | None  # (h, w) metres, NaN without a return

    def visible(self, surface: Surface, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return (n,) bool: visible points (n, 3) of a surface with normals (n, 3), frame of the ground truth."""
        eye, pixels = self.camera.centre, self.camera.project(points)
        visible = self.camera.inside(pixels)
        visible[visible] = surface.seen_from(eye, points[visible], normals[visible])
        if self.ranges is not None:
            distance = np.linalg.norm(points[visible] - eye, axis=1)
            visible[visible] = _has_return(self.ranges, pixels[visible], distance)
        return visible


def true_views(true: Mapping[str, LocalisedRig], positions: set[str], raw: Inventory | None) -> list[TrueView]:
    """Return a view for each position with a true pose, with the range map if the inventory has it."""
    views = []
    for position in sorted(set(true) & positions):
        grid = rectified_left(true[position].rig)
        path = raw.range_maps.get(position) if raw is not None else None
        points = nasa.read_range_map(Path(path), (grid.lens.width, grid.lens.height)) if path else None
        ranges = None if points is None else np.linalg.norm(points, axis=-1)
        camera = Camera(true[position].sandbox_from_left @ grid.left_from_rectified, grid.lens)
        views.append(TrueView(camera, ranges))
    return views


def _has_return(ranges: np.ndarray, pixels: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return (n,) bool: pixels (n, 2) near which a range equals the expected distance (n,)."""
    column, row = np.floor(pixels).astype(int).T
    steps = np.arange(-REACH_PX, REACH_PX + 1)
    rows = np.clip(row[:, None, None] + steps[:, None], 0, ranges.shape[0] - 1)
    columns = np.clip(column[:, None, None] + steps, 0, ranges.shape[1] - 1)
    with np.errstate(invalid="ignore"):
        return (np.abs(ranges[rows, columns] - expected[:, None, None]) < SAME_RANGE).any(axis=(1, 2))  # type: ignore


@dataclass(frozen=True)
class SurfaceSamples:
    """Points (n, 3) on the visible part of a surface, frame of the ground truth, metres."""

    points: np.ndarray
    rock: np.ndarray  # (n,) rock of the point; NO_ROCK for ground
    offset: np.ndarray  # (n,) signed distance to the other surface, metres, negative inside
    other_rock: np.ndarray  # (n,) rock of the nearest point of the other surface
    area: np.ndarray  # (n,) area per sample, m^2

    @property
    def distance(self) -> np.ndarray:
        return np.abs(self.offset)

    def table(self) -> pd.DataFrame:
        """Return rock, position rounded to 0.1 mm, and offset in millimetres rounded to 0.01 mm."""
        x, y, z = np.round(self.points, 4).T
        return pd.DataFrame({"rock": self.rock, "x": x, "y": y, "z": z, "offset_mm": np.round(1000 * self.offset, 2)})


@dataclass(frozen=True)
class Comparison:
    """Samples of both surfaces, and the alignments of the frames."""

    true: SurfaceSamples
    reconstructed: SurfaceSamples
    truth_from_sandbox: Pose  # after an ICP of the ground
    by_cameras: Pose  # before the ICP


def compare_surfaces(
    sandbox: Sandbox, terrain: Terrain, scene: TerrainMesh, cameras: Path, truth: Path, inventory: Path | None
) -> Comparison:
    """Align the meshes of a terrain with the true meshes by camera poses, then by a small rigid ICP of the ground.

    Only visible parts are compared: undersides of rocks, ground below rocks and a strip along the walls are excluded.
    """
    by_cameras, raw = read_alignment(cameras, truth), read_inventory(inventory) if inventory is not None else None
    views = true_views(read_all_localised(truth / "cameras"), set(read_all_localised(cameras)), raw)
    half = np.array(sandbox.half_width_m)
    true_scene = read_terrain(truth / "meshes", terrain, sandbox)
    true_surface = Surface(true_scene.vertices, true_scene.faces)
    rng = generator(SEED, "surface samples", terrain)
    points, rock, area = _visible_points(true_surface, true_scene.rock_of_face, views, half, rng)
    alignment = refine_alignment(by_cameras, points[rock == NO_ROCK], Surface(scene.vertices, scene.faces))
    surface = Surface(alignment.apply(scene.vertices), scene.faces)
    true = SurfaceSamples(points, rock, *_signed_distance(surface, scene.rock_of_face, points), area)
    points, rock, area = _visible_points(surface, scene.rock_of_face, views, half, rng)
    distances = _signed_distance(true_surface, true_scene.rock_of_face, points)
    return Comparison(true, SurfaceSamples(points, rock, *distances, area), alignment, by_cameras)


def _visible_points(
    surface: Surface, rock_of_face: np.ndarray, views: list[TrueView], half: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the visible points, their rocks and the area per point, within half widths (2,) along X and Y, metres.

    Before the visibility test, `SURFACE_SAMPLES` points are sampled on rocks and on the ground.
    """
    parts = []
    for selected in (rock_of_face != NO_ROCK, rock_of_face == NO_ROCK):
        if not selected.any():
            continue
        faces = np.flatnonzero(selected)
        part = Surface(surface.vertices, surface.faces[faces])
        points, face = part.sample(SURFACE_SAMPLES, rng)
        visible = np.logical_or.reduce([view.visible(surface, points, part.normals[face]) for view in views])
        visible &= (np.abs(points[:, :2]) < half - EDGE).all(axis=1)
        area = part.area.sum() / SURFACE_SAMPLES
        parts.append((points[visible], rock_of_face[faces[face[visible]]], np.full(visible.sum(), area)))
    points, rock, areas = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return points, rock, areas


def _signed_distance(surface: Surface, rock_of_face: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the signed distances (n,) of points to a surface, and the rocks (n,) of the nearest surface points."""
    nearest, face = surface.nearest(points)
    offset = points - nearest
    side = np.einsum("nk,nk->n", offset, surface.normals[face])
    return np.copysign(np.linalg.norm(offset, axis=1), side), rock_of_face[face]

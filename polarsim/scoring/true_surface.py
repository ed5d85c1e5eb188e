"""Our meshes and the true ones laid on each other: points on the seen part of each, and where the other one lies."""

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
from polarsim.photo import NO_ROCK
from polarsim.randomness import generator
from polarsim.run_files.inventory import Inventory, read_inventory
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.scoring.alignment import read_alignment, refine_alignment
from polarsim.scoring.surface import Surface
from polarsim.survey import half_width

SEED = 0  # of the points that are sampled on surfaces
SURFACE_SAMPLES = 20_000  # points on the rocks, and on the ground
EDGE = 0.1  # metres: a strip along the walls does not count as ground
REACH_PX = 3  # a return so near in the map counts as the point's: maps are registered to a pixel or two
SAME_RANGE = 0.015  # metres between a point's distance and the return's


@dataclass(frozen=True)
class TrueView:
    """One position's view of the true scene."""

    camera: Camera  # rectified, in the true frame
    ranges: np.ndarray | None  # (h, w) metres, NaN without a return

    def sees(self, surface: Surface, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(n,) whether points (n, 3) of a surface with normals (n, 3), all in the true frame, are seen."""
        eye, pixels = self.camera.centre, self.camera.project(points)
        seen = self.camera.inside(pixels)
        seen[seen] = surface.seen_from(eye, points[seen], normals[seen])
        if self.ranges is not None:
            seen[seen] = _returned(self.ranges, pixels[seen], np.linalg.norm(points[seen] - eye, axis=1))
        return seen


def true_views(true: Mapping[str, LocalisedRig], positions: set[str], known: Inventory | None) -> list[TrueView]:
    """A view for each of `positions` that has a true pose; with its range map where the inventory names one.

    Raises
    ------
    FormatError
        A range map is broken.
    """
    found = []
    for position in sorted(set(true) & positions):
        grid = rectified_left(true[position].rig)
        path = known.range_maps.get(position) if known is not None else None
        points = nasa.read_range_map(Path(path), (grid.lens.width, grid.lens.height)) if path else None
        ranges = None if points is None else np.linalg.norm(points, axis=-1)
        camera = Camera(true[position].sandbox_from_left @ grid.left_from_rectified, grid.lens)
        found.append(TrueView(camera, ranges))
    return found


def _returned(ranges: np.ndarray, pixels: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """(n,) whether a range near pixels (n, 2) is the expected one (n,)."""
    column, row = np.floor(pixels).astype(int).T
    found = np.zeros(len(pixels), bool)
    steps = range(-REACH_PX, REACH_PX + 1)
    with np.errstate(invalid="ignore"):
        for down in steps:
            for across in steps:
                beside = ranges[
                    np.clip(row + down, 0, ranges.shape[0] - 1), np.clip(column + across, 0, ranges.shape[1] - 1)
                ]
                found |= np.abs(beside - expected) < SAME_RANGE
    return found


@dataclass(frozen=True)
class Samples:
    """Points (n, 3) on the seen part of a surface, true frame, metres."""

    points: np.ndarray
    rock: np.ndarray  # (n,) whose surface they lie on; NO_ROCK for ground
    offset: np.ndarray  # (n,) metres to the other surface, below 0 inside it
    beside: np.ndarray  # (n,) rock of the other surface there
    area: np.ndarray  # (n,) m^2 that a point stands for

    @property
    def distance(self) -> np.ndarray:
        return np.abs(self.offset)

    def table(self) -> pd.DataFrame:
        """Rock, position to a tenth of a millimetre, offset in millimetres to a hundredth."""
        x, y, z = np.round(self.points, 4).T
        return pd.DataFrame({"rock": self.rock, "x": x, "y": y, "z": z, "offset_mm": np.round(1000 * self.offset, 2)})


@dataclass(frozen=True)
class Comparison:
    """Samples of both surfaces, and the frames that brought them together."""

    true: Samples
    ours: Samples
    truth_from_sandbox: Pose  # after an ICP of the ground
    by_cameras: Pose  # before


def compare(terrain: int, scene: TerrainMesh, cameras: Path, truth: Path, inventory: Path | None) -> Comparison:
    """Lay a terrain's meshes on the true ones: by the camera poses, then by one small rigid ICP of the ground.

    What nobody saw nobody can measure: undersides, and ground below rocks. A strip along the walls is left out too.
    """
    by_cameras, known = read_alignment(cameras, truth), read_inventory(inventory) if inventory is not None else None
    views = true_views(read_all_localised(truth / "cameras"), set(read_all_localised(cameras)), known)
    true_scene = read_terrain(truth / "meshes", terrain)
    true_surface = Surface(true_scene.vertices, true_scene.faces)
    rng = generator(SEED, "surface samples", terrain)
    points, rock, area = _seen_points(true_surface, true_scene.rock_of_face, views, half_width(terrain), rng)
    alignment = refine_alignment(by_cameras, points[rock == NO_ROCK], Surface(scene.vertices, scene.faces))
    our_surface = Surface(alignment.apply(scene.vertices), scene.faces)
    true = Samples(points, rock, *_beside(our_surface, scene.rock_of_face, points), area)
    points, rock, area = _seen_points(our_surface, scene.rock_of_face, views, half_width(terrain), rng)
    ours = Samples(points, rock, *_beside(true_surface, true_scene.rock_of_face, points), area)
    return Comparison(true, ours, alignment, by_cameras)


def _seen_points(
    surface: Surface, rock_of_face: np.ndarray, views: list[TrueView], half: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points that were seen, of `SURFACE_SAMPLES` on rocks and as many on ground within a half width (metres).

    The rock of each, and the area that it stands for.
    """
    parts = []
    for wanted in (rock_of_face != NO_ROCK, rock_of_face == NO_ROCK):
        if not wanted.any():
            continue
        faces = np.flatnonzero(wanted)
        part = Surface(surface.vertices, surface.faces[faces])
        points, face = part.sample(SURFACE_SAMPLES, rng)
        seen = np.logical_or.reduce([view.sees(surface, points, part.normals[face]) for view in views])
        seen &= (np.abs(points[:, :2]) < half - EDGE).all(axis=1)
        area = part.area.sum() / SURFACE_SAMPLES
        parts.append((points[seen], rock_of_face[faces[face[seen]]], np.full(seen.sum(), area)))
    points, rock, areas = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return points, rock, areas


def _beside(surface: Surface, rock_of_face: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance (n,) of points to a surface, and the rock (n,) that it belongs to there."""
    nearest, face = surface.nearest(points)
    away = points - nearest
    side = np.einsum("nk,nk->n", away, surface.normals[face])
    return np.copysign(np.linalg.norm(away, axis=1), side), rock_of_face[face]

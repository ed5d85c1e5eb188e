"""Which places of a surface were seen: by a scan, as its range map tells, or, where there is none, by a camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import nasa
from polarsim.formats.inventory import Inventory
from polarsim.formats.rigs import PlacedRig
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.stereo import rectified_left
from polarsim.scoring.surface import Surface

REACH_PX = 3  # a return so near in the map counts as the point's: maps are registered to a pixel or two
SAME_RANGE = 0.015  # metres between a point's distance and the return's


@dataclass(frozen=True)
class Sight:
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


def sights(true: Mapping[str, PlacedRig], positions: set[str], known: Inventory | None) -> list[Sight]:
    """A sight for each of `positions` that has a true pose; with its range map where the inventory names one.

    Raises
    ------
    FormatError
        A range map is broken.
    """
    found = []
    for position in sorted(set(true) & positions):
        grid = rectified_left(true[position].rig)
        path = known.range_maps.get(position) if known is not None else None
        ranges = _read_ranges(Path(path), grid.lens) if path else None
        camera = Camera(true[position].sandbox_from_left @ grid.left_from_rectified, grid.lens)
        found.append(Sight(camera, ranges))
    return found


def _read_ranges(path: Path, lens: Lens) -> np.ndarray:
    return np.asarray(np.linalg.norm(nasa.read_range_map(path, (lens.width, lens.height)), axis=-1))


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

"""View of a scene beyond the sandbox: camera, and nodes of the ground that are evenly spaced in its image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose
from polarsim.photo import REFERENCE_SIZE_PX, REFERENCE_WIDTH_PX
from polarsim.scenes.field_options import TARGET_M, FieldRanges, log_uniform

HILLS = 400.0  # distance of the last row, over `TARGET_M`
_FAR = 60.0  # distance of the farthest rocks, over `TARGET_M`
_FAR_OF_NEAREST = 8.0  # minimum distance of the farthest rocks over that of the nearest ground in the image
_CELL_PX = 3.0  # cell of the ground in the image
_MARGIN = 1.3  # extent of the grid over that of the image: objects outside cast shadows into the image
_MAX_GROWTH = 0.025  # maximum step between rows over the depth
_HILL_GROWTH = 0.12  # step between rows of hills over the distance
_NADIR_DEG = 88.0  # maximum pitch


@dataclass(frozen=True)
class FieldView:
    """Camera above the origin that looks along +x, and the nodes of the ground that are evenly spaced in its image.

    A row has a constant depth; the columns are at constant tangents of the horizontal angle of view.
    """

    camera: Camera
    pitch: float  # depression of the optical axis, radians
    tangent: float  # of half the horizontal field of view
    far: float  # x of the farthest rocks, metres
    forward: np.ndarray  # (rows,) x of the rows, metres, ascending
    tangents: np.ndarray  # (columns,)

    @property
    def height(self) -> float:
        """Height of the camera above the level ground, metres."""
        return float(self.camera.centre[2])

    @property
    def width(self) -> float:
        """Width of the image at the ground in the middle of the lower half of the image, metres."""
        down = 0.5 * self.tangent * REFERENCE_SIZE_PX[1] / REFERENCE_WIDTH_PX
        return float(2 * self.tangent * self.height / (np.sin(self.pitch) + down * np.cos(self.pitch)))

    @cached_property
    def depth(self) -> np.ndarray:
        """Depth (rows,) of the rows along the optical axis, metres."""
        return self.depth_at(self.forward)

    @cached_property
    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y (rows, columns) of the nodes, metres."""
        y = self.depth[:, None] * self.tangents
        return np.broadcast_to(self.forward[:, None], y.shape), y

    @cached_property
    def cell(self) -> np.ndarray:
        """Side (rows, 1) of a cell across the view, metres."""
        return self.depth[:, None] * (self.tangents[1] - self.tangents[0])

    def depth_at(self, x: np.ndarray) -> np.ndarray:
        """Return the depth of points of level ground with coordinate x, metres."""
        return np.asarray(x * np.cos(self.pitch) + self.height * np.sin(self.pitch))

    def width_at(self, x: np.ndarray) -> np.ndarray:
        """Return the width of the image at points of level ground with coordinate x, metres."""
        return 2 * self.tangent * self.depth_at(x)

    def cells_of(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows and columns of the nodes nearest to points (n, 2 or 3)."""
        row = np.interp(points[:, 0], self.forward, np.arange(len(self.forward)))
        depth = np.maximum(self.depth_at(points[:, 0]), 1e-6)
        column = np.interp(points[:, 1] / depth, self.tangents, np.arange(len(self.tangents)))
        return np.rint(row).astype(int), np.rint(column).astype(int)

    def draw_points(self, count: int, evenness: float, random: np.random.Generator) -> np.ndarray:
        """Return points (n, 2) of level ground, from even in the image (0) to even on the ground (1)."""
        limit = self.tangent * REFERENCE_SIZE_PX[1] / REFERENCE_WIDTH_PX
        hit = np.zeros(0, bool)
        while not hit.any():  # all points may be above the horizon
            across = random.uniform(-1, 1, 4 * count) * self.tangent * 1.05
            slope = np.sin(self.pitch) + random.uniform(-1, 1, 4 * count) * limit * np.cos(self.pitch)
            hit = slope > self.height / self.far
        depth = self.height / slope[hit]
        x = (depth - self.height * np.sin(self.pitch)) / np.cos(self.pitch)
        weight = depth ** (3 * evenness)
        chosen = random.choice(len(x), count, p=weight / weight.sum())
        return np.stack([x, depth * across[hit]], axis=1)[chosen]


def draw_view(ranges: FieldRanges, random: np.random.Generator) -> FieldView:
    """Return a random view with ground in at least a quarter of the image."""
    half = np.radians(log_uniform(ranges.field_of_view_deg, random)) / 2
    tangent = float(np.tan(half))
    upright = tangent * REFERENCE_SIZE_PX[1] / REFERENCE_WIDTH_PX  # tangent of half the vertical field of view
    if random.random() < ranges.horizon_share:  # the horizon is in the upper half of the image
        pitch = float(np.arctan(random.uniform(0.1, 0.95) * upright))
    else:
        pitch = float(np.radians(random.uniform(*ranges.pitch_deg)))
        pitch = min(max(pitch, float(np.arctan(1.1 * upright))), float(np.radians(_NADIR_DEG)))
    height = TARGET_M * max(np.sin(pitch), random.uniform(*ranges.low_height))
    width, height_px = REFERENCE_SIZE_PX
    focal = width / (2 * tangent)
    lens = Lens(focal, focal, width / 2, height_px / 2, width=width, height=height_px)
    roll = float(np.radians(2) * random.standard_normal())
    camera = Camera(camera_pose(np.array([0.0, 0, height]), 0.0, pitch, roll), lens).scaled(ranges.scale)
    step = _CELL_PX / camera.lens.fx
    columns = int(np.ceil(2 * _MARGIN * tangent / step))
    tangents = np.linspace(-_MARGIN * tangent, _MARGIN * tangent, columns)
    sine, cosine = np.sin(pitch), np.cos(pitch)
    nearest = height * (cosine - upright * sine) / (sine + upright * cosine)
    far = float(max(_FAR * TARGET_M, _FAR_OF_NEAREST * nearest))
    return FieldView(camera, pitch, tangent, far, _rows(pitch, height, upright, step, far), tangents)


def _rows(pitch: float, height: float, upright: float, step: float, far: float) -> np.ndarray:
    """Return x (rows,) of the rows of the grid, from below the image to the farthest ground in the image or hills."""
    sine, cosine = np.sin(pitch), np.cos(pitch)

    def ground_at(down: float) -> float:
        return float(height * (cosine - down * sine) / (sine + down * cosine))

    top = sine - _MARGIN * upright * cosine
    horizon = top <= height / far
    last = far if horizon else ground_at(-_MARGIN * upright)
    x = [ground_at(_MARGIN * upright)]
    while x[-1] < last:
        depth = x[-1] * cosine + height * sine
        x.append(x[-1] + depth * min(depth / height * step, _MAX_GROWTH))
    while horizon and x[-1] < HILLS * TARGET_M:
        x.append(x[-1] * (1 + _HILL_GROWTH))
    return np.array(x)

"""Points of a scan (range map or cloud) in the left camera frame, without mixed pixels and outliers."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import shapely

from polarsim.errors import FormatError, with_path
from polarsim.formats import nasa
from polarsim.formats.clouds import read_cloud
from polarsim.geometry.casters import make_caster
from polarsim.geometry.lens import Lens
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.run_files.inventory import Inventory
from polarsim.site_file_names import Files

GRAZING_JUMP = 8.0  # maximum range difference of neighbours over their spacing: grazing angles of more than 7 degrees
NOISE_JUMP = 0.010  # metres; range difference of neighbours due to noise (2 mm, 5 sigma)
MIN_AGREEING = 5  # minimum number of the 8 neighbours on the same surface; a pixel at a straight edge has 5
_ALL, _BUT_LAST, _BUT_FIRST = slice(None), slice(None, -1), slice(1, None)
_NEIGHBOURS = (  # each pair of neighbours once: (rows, columns) of the first and of the second pixels
    ((_ALL, _BUT_LAST), (_ALL, _BUT_FIRST)),
    ((_BUT_LAST, _ALL), (_BUT_FIRST, _ALL)),
    ((_BUT_LAST, _BUT_LAST), (_BUT_FIRST, _BUT_FIRST)),
    ((_BUT_LAST, _BUT_FIRST), (_BUT_FIRST, _BUT_LAST)),
)
_DISTANCES_M = 0.1, 1000.0  # of the points of a cloud from the camera; other values mean another unit
MIN_POINTS = 1000  # of a cloud in the image of the left camera
FINER = 4.0  # resolution of an interpolated cloud over that of its range map
MAX_GAP_PX = 3.0  # longest side of an interpolated triangle, pixels of the range map
PIXELS_PER_POINT = 0.7  # along a side, of the range map of a cloud: 7 of 8 pixels have a point


def read_scan(
    inventory: Inventory, position: str, rig: StereoRig, files: Files, *, interpolated: bool = False
) -> np.ndarray:
    """Read the points (n, 3) of a scan in the left camera frame, metres. A range map is preferred to a cloud.

    `files` states frame and unit of the clouds.
    `interpolated`: interpolate clouds to about the density of NASA's range maps, for grids of heights without holes.
    Registration is more accurate with the means of measured points.
    """
    grid = rectified_left(rig)
    lens, path = grid.lens, inventory.range_maps.get(position)
    if path is not None:
        range_map = nasa.read_range_map(path, (lens.width, lens.height))
        points = range_map[trusted_pixels(range_map, lens.fx)].astype(float)
    else:
        cloud = _read_cloud(Path(inventory.clouds[position]), files.cloud_unit)
        if files.cloud_frame == "left":
            cloud = grid.left_from_rectified.inverse().apply(cloud)
        with with_path(inventory.clouds[position]):
            points, means, coarse = surface_of_cloud(cloud, lens)
        if not interpolated:
            points = means
        elif len(points):
            points = interpolate(points, coarse.fx, lens.scaled(min(1.0, FINER * coarse.width / lens.width)))
    return np.asarray(grid.left_from_rectified.apply(points))


def _read_cloud(path: Path, unit: Literal["mm", "m"]) -> np.ndarray:
    """Read the points (n, 3) of a cloud, metres; raise an error if most are too near or too far for a sandbox."""
    cloud = read_cloud(path, unit)
    median = float(np.median(np.linalg.norm(cloud, axis=1)))
    if not _DISTANCES_M[0] <= median <= _DISTANCES_M[1]:
        raise FormatError(f"the median distance of the points is {median:.3g} m: check files.cloud_unit", path=path)
    return cloud


def trusted_pixels(range_map: np.ndarray, focal_px: float) -> np.ndarray:
    """Return the mask (h, w) of the pixels of a range map (h, w, 3) that are on a surface.

    A beam that hits an edge returns a range between both surfaces (mixed pixel), and some ranges are outliers. Such
    pixels differ from their neighbours. A pixel on a surface or at the edge of a surface has enough neighbours with a
    similar range. Surfaces at grazing angles are removed together with mixed pixels.
    """
    distance = np.linalg.norm(range_map, axis=-1)
    allowed = _allowed_jump(distance, focal_px)
    agreeing = np.zeros(distance.shape, np.uint8)
    with np.errstate(invalid="ignore"):
        for first, second in _NEIGHBOURS:
            agree = np.abs(distance[first] - distance[second]) < allowed[first]
            agreeing[first] += agree
            agreeing[second] += agree
    return agreeing >= MIN_AGREEING


def _allowed_jump(distance: np.ndarray, focal_px: float) -> np.ndarray:
    """Return the maximum range difference of neighbouring pixels on a surface at a distance, metres."""
    return np.maximum(NOISE_JUMP, GRAZING_JUMP * distance / focal_px)


def surface_of_cloud(cloud: np.ndarray, lens: Lens) -> tuple[np.ndarray, np.ndarray, Lens]:
    """Return the points (m, 3) of a cloud (n, 3) on the nearest surface of trusted pixels, and the means of the pixels.

    Both are in the rectified left frame. The trusted pixels are those of a range map of the means, whose lens is
    also returned. The resolution of the map is chosen such that most pixels have a point, because `trusted_pixels`
    compares adjacent pixels. A cloud with few points in the image raises FormatError.
    """
    pixels = lens.project(cloud)
    inside = np.isfinite(pixels).all(axis=1)
    inside &= ((pixels >= 0) & (pixels < [lens.width, lens.height])).all(axis=1)
    if inside.sum() < MIN_POINTS:
        raise FormatError(
            f"the image of the left camera contains {inside.sum()} of {len(cloud)} points, {MIN_POINTS} needed: "
            "transform clouds from the frame of the scanner to files.cloud_frame"
        )
    factor = min(1.0, PIXELS_PER_POINT * np.sqrt(inside.sum() / (lens.width * lens.height)))
    coarse = lens.scaled(factor)
    column, row = np.floor(pixels[inside] * factor).astype(int).T
    column, row = np.minimum(column, coarse.width - 1), np.minimum(row, coarse.height - 1)
    points, pixel = cloud[inside], row * coarse.width + column
    distance = np.linalg.norm(points, axis=1)
    nearest = np.full(coarse.width * coarse.height, np.inf)
    np.minimum.at(nearest, pixel, distance)
    front = distance <= (nearest + _allowed_jump(nearest, coarse.fx))[pixel]
    points, pixel = points[front], pixel[front]
    sums = [np.bincount(pixel, axis, len(nearest)) for axis in points.T]
    with np.errstate(invalid="ignore"):
        mean = np.stack(sums, axis=-1) / np.bincount(pixel, minlength=len(nearest))[:, None]
    trusted = trusted_pixels(mean.reshape(coarse.height, coarse.width, 3), coarse.fx).ravel()
    return points[trusted[pixel]], mean[trusted], coarse


def interpolate(points: np.ndarray, focal_px: float, lens: Lens) -> np.ndarray:
    """Return the surface points (m, 3) at the pixels of a lens, from triangles between points (n, 3) of a range map.

    `focal_px`: focal length of the range map. Triangles across gaps or depth edges are excluded.
    """
    # GEOS keeps the depth of the points and takes half of the time of Qhull. Its triangles are closed rings.
    in_image = shapely.linestrings(np.column_stack([points[:, :2] / points[:, 2:], points[:, 2]]))
    in_image = shapely.get_coordinates(shapely.delaunay_triangles(in_image), include_z=True).reshape(-1, 4, 3)[:, :3]
    corners = np.concatenate([in_image[..., :2], np.ones_like(in_image[..., :1])], axis=-1) * in_image[..., 2:]
    distance = np.linalg.norm(corners, axis=-1)
    side = np.linalg.norm(in_image[..., :2] - np.roll(in_image[..., :2], 1, axis=1), axis=-1)
    joined = np.ptp(distance, axis=1) < _allowed_jump(distance.min(axis=1), focal_px)
    joined &= focal_px * side.max(axis=1) < MAX_GAP_PX
    surface = make_caster(corners[joined].reshape(-1, 3), np.arange(3 * joined.sum()).reshape(-1, 3))
    directions = lens.pixel_directions().reshape(-1, 3)
    depth, _ = surface.nearest(np.zeros_like(directions), directions)
    return np.asarray((directions * depth[:, None])[np.isfinite(depth)])

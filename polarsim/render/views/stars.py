"""Stars in the background, with real positions and brightness from the table `hipparcos.parquet` in this folder.

Source: ESA's Hipparcos catalogue, the new reduction (van Leeuwen, Astronomy & Astrophysics 474 (2007) 653; VizieR
I/311), which is in the public domain. The table contains the stars down to magnitude 7, with proper motion applied
from 1991.25 to 2025, sorted by magnitude.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.render.hits import cast_strip, for_strips
from polarsim.render.surfaces import Surfaces
from polarsim.render.views.moon import on_sphere

COLUMNS = ("hip", "ra_deg", "dec_deg", "hp_mag")
TABLE = Path(__file__).with_name("hipparcos.parquet")
SUN_MAGNITUDE = -26.61  # Hp, 1 AU away: irradiance 1; V is -26.74, and Hp 0.13 fainter for the Sun's twin 18 Scorpii


@cache
def stars() -> pd.DataFrame:
    """Return the table of stars, brightest first: number, J2000 equatorial position as of 2025, magnitude Hp."""
    return tables.read_parquet(TABLE, COLUMNS)


def star_directions(ra_deg: np.ndarray, dec_deg: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) to right ascensions and declinations (n,), degrees."""
    return on_sphere(np.radians(np.asarray(ra_deg, float)), np.radians(np.asarray(dec_deg, float)))


@dataclass(frozen=True)
class Sky:
    """Stars: unit directions (n, 3) in the J2000 equatorial frame, and irradiance (n,) relative to the Sun."""

    directions: np.ndarray
    irradiance: np.ndarray


def build_sky(intensity: float = 1.0) -> Sky:
    """Return all stars of the table, brightest first; `intensity`: flux relative to real stars."""
    table = stars()
    towards = star_directions(table["ra_deg"].to_numpy(), table["dec_deg"].to_numpy())
    return Sky(towards, intensity * 10 ** (-0.4 * (table["hp_mag"].to_numpy(float) - SUN_MAGNITUDE)))


def sky_mask(surfaces: Surfaces, camera: Camera, threads: int) -> np.ndarray:
    """Return the pixels (h, w) bool without a surface at the pixel centre."""
    surfaces.prepare(shadows=False)
    empty = np.ones(camera.lens.shape, bool)

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, camera, rows, smooth=False)
        empty[rows].reshape(-1)[hits.pixel] = False

    for_strips(camera.lens.height, threads, work)
    return empty


def star_radiance(sky: Sky, sandbox_from_celestial: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the radiance (h, w) float32 of the sky, on the scale of OLAT images: the irradiance of the Sun is 1.

    A star is a point: the light is distributed over the nearest 2 x 2 pixels with bilinear weights. The radiance of a
    pixel is irradiance divided by the solid angle of the pixel.
    """
    lens = camera.lens
    celestial_from_camera = sandbox_from_celestial.T @ camera.world_from_camera.rotation
    in_camera = sky.directions @ celestial_from_camera
    visible = in_camera[:, 2] > _min_cosine(lens)  # the distortion polynomial folds back outside the image corners
    pixel = lens.project(in_camera[visible]) - HALF_PIXEL
    corner = np.floor(pixel).astype(np.int64)
    share = pixel - corner
    solid_angle = in_camera[visible, 2] ** 3 / (lens.fx * lens.fy)  # of a pixel, neglecting the slight distortion
    radiance = np.zeros(lens.shape)
    for down in (0, 1):
        for right in (0, 1):
            weight = np.prod(np.where([right, down], share, 1 - share), axis=1)
            column, row = corner[:, 0] + right, corner[:, 1] + down
            inside = (column >= 0) & (column < lens.width) & (row >= 0) & (row < lens.height)
            light = (sky.irradiance[visible] * weight / solid_angle)[inside]
            np.add.at(radiance, (row[inside], column[inside]), light)
    return radiance.astype(np.float32)


def sky_images(
    sky: Sky,
    rotations: Mapping[str, np.ndarray],
    surfaces: Surfaces,
    camera: Camera,
    threads: int,
) -> dict[str, np.ndarray]:
    """Return the radiance (h, w) float32 of the stars behind a scene, by the name of each rotation.

    `rotations` are `sandbox_from_celestial` (3, 3). Equal rotations share the same image.
    """
    empty = sky_mask(surfaces, camera, threads)
    images: dict[bytes, np.ndarray] = {}
    for rotation in rotations.values():
        if rotation.tobytes() not in images:
            images[rotation.tobytes()] = empty * star_radiance(sky, rotation, camera)
    return {name: images[rotation.tobytes()] for name, rotation in rotations.items()}


def _min_cosine(lens: Lens) -> float:
    """Return the cosine to the optical axis of the farthest image corner, plus a margin of one pixel."""
    corners = np.array([[x, y] for x in (-1.0, lens.width + 1.0) for y in (-1.0, lens.height + 1.0)])
    directions = lens.directions(corners)
    return float((1 / np.linalg.norm(directions, axis=1)).min())

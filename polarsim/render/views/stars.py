"""The real stars behind the scene, as bright as they are: those of a table beside this file.

Source: ESA's Hipparcos, the new reduction (van Leeuwen, Astronomy & Astrophysics 474 (2007) 653; VizieR I/311), which
is in the public domain. The table has its stars down to `FAINTEST_MAG`, each moved by its proper motion from 1991.25 to
2025, sorted by magnitude.
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
from polarsim.render.views.options import StarField

COLUMNS = ("hip", "ra_deg", "dec_deg", "hp_mag")
TABLE = Path(__file__).with_name("hipparcos.parquet")
SUN_MAGNITUDE = -26.61  # Hp, 1 AU away: irradiance 1; V is -26.74, and Hp 0.13 fainter for the Sun's twin 18 Scorpii


@cache
def stars() -> pd.DataFrame:
    """The table, `COLUMNS`, brightest first: number, position on J2000's equator as of 2025, magnitude Hp."""
    return tables.read_parquet(TABLE, COLUMNS)


def directions(ra_deg: np.ndarray, dec_deg: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors to points (n,) in degrees."""
    return on_sphere(np.radians(np.asarray(ra_deg, float)), np.radians(np.asarray(dec_deg, float)))


@dataclass(frozen=True)
class Sky:
    """Stars: directions (n, 3), unit, in the frame of J2000's equator, and irradiance (n,) over the Sun's."""

    directions: np.ndarray
    irradiance: np.ndarray


def sky_of(field: StarField) -> Sky:
    """The stars down to a magnitude, brightest first."""
    table = stars()
    table = table[table["hp_mag"] <= field.faintest_mag]
    towards = directions(table["ra_deg"].to_numpy(), table["dec_deg"].to_numpy())
    magnitudes = table["hp_mag"].to_numpy(float)
    return Sky(towards, field.intensity * 10 ** (-0.4 * (magnitudes - SUN_MAGNITUDE)))


def sky_mask(surfaces: Surfaces, camera: Camera, threads: int) -> np.ndarray:
    """(h, w) bool: pixels whose centre's ray meets no surface."""
    surfaces.prepare(shadows=False)
    empty = np.ones(camera.lens.shape, bool)

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, camera, rows, smooth=False)
        empty[rows].reshape(-1)[hits.pixel] = False

    for_strips(camera.lens.height, threads, work)
    return empty


def star_radiance(sky: Sky, sandbox_from_celestial: np.ndarray, camera: Camera) -> np.ndarray:
    """(h, w) float32 radiance of the sky through a lens, on the scale of OLAT images: the Sun's irradiance is 1.

    A star is a point: its light falls on the 2 x 2 pixels around its position, in bilinear shares, and a pixel's
    radiance is irradiance over the solid angle that it sees.
    """
    lens = camera.lens
    celestial_from_camera = sandbox_from_celestial.T @ camera.world_from_camera.rotation
    in_camera = sky.directions @ celestial_from_camera
    seen = in_camera[:, 2] > _least_cosine(lens)  # beyond the corners the distortion's polynomial folds back
    pixel = lens.project(in_camera[seen]) - HALF_PIXEL
    corner = np.floor(pixel).astype(np.int64)
    share = pixel - corner
    solid_angle = in_camera[seen, 2] ** 3 / (lens.fx * lens.fy)  # of a pixel, without the lens's slight distortion
    radiance = np.zeros(lens.shape)
    for down in (0, 1):
        for right in (0, 1):
            weight = np.prod(np.where([right, down], share, 1 - share), axis=1)
            column, row = corner[:, 0] + right, corner[:, 1] + down
            inside = (column >= 0) & (column < lens.width) & (row >= 0) & (row < lens.height)
            light = (sky.irradiance[seen] * weight / solid_angle)[inside]
            np.add.at(radiance, (row[inside], column[inside]), light)
    return radiance.astype(np.float32)


def sky_images(
    sky: Sky,
    rotations: Mapping[str, np.ndarray],
    surfaces: Surfaces,
    camera: Camera,
    threads: int,
) -> dict[str, np.ndarray]:
    """(h, w) float32 radiance of stars behind a scene, by name of each rotation, `sandbox_from_celestial` (3, 3)."""
    empty = sky_mask(surfaces, camera, threads)
    olat_images: dict[bytes, np.ndarray] = {}  # lights without a date share one
    for rotation in rotations.values():
        if rotation.tobytes() not in olat_images:
            olat_images[rotation.tobytes()] = empty * star_radiance(sky, rotation, camera)
    return {name: olat_images[rotation.tobytes()] for name, rotation in rotations.items()}


def _least_cosine(lens: Lens) -> float:
    """Cosine to the optical axis of the picture's farthest corner, a pixel outside it."""
    corners = np.array([[x, y] for x in (-1.0, lens.width + 1.0) for y in (-1.0, lens.height + 1.0)])
    directions = lens.directions(corners)
    return float((1 / np.linalg.norm(directions, axis=1)).min())

"""Brightness of an exposure bracket, from photos, or from OLAT images of the meshes if photos are missing.

These OLAT images contain only direct light on Lambertian meshes, scaled to the grey values of NASA's photos. This is
sufficient to decide which labels are visible at an exposure.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from polarsim.labels.association import TerrainRocks
from polarsim.labels.bodies import active_lamp
from polarsim.labels.projection import sightlines
from polarsim.photo import (
    BLACK_LEVEL,
    CENTRE_DN,
    ELECTRONS_PER_DN,
    NO_SUN,
    READ_NOISE_ELECTRONS,
    WHITE_LEVEL,
    Azimuth,
    Bracket,
    CameraSide,
    Terrain,
    by_bracket,
)
from polarsim.photo_format import step_dn
from polarsim.run_files.brackets import read_rate
from polarsim.run_files.pictures import pictures_at
from polarsim.site import Site

log = logging.getLogger("polarsim")

READ_NOISE_DN = READ_NOISE_ELECTRONS / ELECTRONS_PER_DN
CACHED_BRACKETS = 4  # number of brackets in memory, 10 MB each
SKY_SHARE = 0.01  # share of the light of a lamp that arrives uniformly from the sky
STEP_PX = 2  # pixel step of OLAT images, fine enough for the contrast of boxes
CACHED_VIEWS = 2  # number of views in memory, 5 MB for each lamp


@dataclass(frozen=True)
class Brightness:
    """Grey values above black per millisecond (h, w) float32, and the exposures of the bracket, ms."""

    rate: np.ndarray
    exposures_ms: tuple[int, ...]
    step_dn: float  # difference of two adjacent values of the photo files, in polarsim's photo format

    def noise_dn(self, signal_dn: float) -> float:
        """Return `noise_dn` of a photo with these steps."""
        return float(noise_dn(signal_dn, self.step_dn))

    def at(self, exposure_ms: float, part: tuple[slice, slice] = (slice(None), slice(None))) -> np.ndarray:
        """Return grey values above black of a part of the photo at an exposure, clipped at the white level."""
        return np.minimum(self.rate[part] * exposure_ms, WHITE_LEVEL - BLACK_LEVEL)


def noise_dn(signal_dn: np.ndarray | float, step: float = 1.0) -> np.ndarray:
    """Return the standard deviation of a pixel with mean `signal_dn` above black: shot and read noise, and rounding.

    `step` is the difference of adjacent values, DN. The read noise of values of 12 bits includes steps of 1 DN.
    """
    return np.sqrt(np.maximum(signal_dn, 0.0) / ELECTRONS_PER_DN + READ_NOISE_DN**2 + (step**2 - 1) / 12)


class PhotoBrightness:
    """Photos of one terrain, read on demand. A source without photos has none."""

    def __init__(self, index: Path, terrain: Terrain, step: float) -> None:
        self.terrain, self._step = terrain, step
        pictures = {key: path for key, path in pictures_at(index).items() if key.terrain == terrain}
        self._brackets = {
            bracket: [(key.exposure_ms, pictures[key]) for key in keys]
            for bracket, keys in by_bracket(pictures).items()
        }
        self.brightness = lru_cache(maxsize=CACHED_BRACKETS)(self._brightness)

    def _brightness(self, bracket: Bracket) -> Brightness | None:
        """Return the rates and exposures of a bracket; None without a readable photo."""
        rate, exposures = read_rate(self._brackets.get(bracket, ()), None, "skipped in the propagation of labels")
        return None if rate is None else Brightness(rate, exposures, self._step)


@dataclass(frozen=True)
class VisibleSurface:
    """Mask (h, w) of pixels that hit the terrain, with points and unit normals (n, 3) of the hits."""

    hit: np.ndarray
    points: np.ndarray
    normals: np.ndarray


class OlatBrightness:
    """Brightness like `PhotoBrightness`, computed from meshes, domes and lamps.

    At the usual exposure of the site, level sand at the centre has `CENTRE_DN` under the first Sun lamp.
    """

    def __init__(self, terrain_rocks: TerrainRocks, site: Site) -> None:
        self.terrain_rocks, self._step = terrain_rocks, step_dn(site.images)
        self._scale = CENTRE_DN / site.usual_exposure_ms / _level_cosine(site)
        self._surface = lru_cache(maxsize=CACHED_VIEWS)(self._visible_surface)
        self._olat_image = lru_cache(maxsize=CACHED_VIEWS * (len(terrain_rocks.world.suns) + 1))(self._lit)

    def brightness(self, bracket: Bracket) -> Brightness | None:
        """Return the sum of the OLAT images of the active lamps, without exposures; None if the pose is unverified."""
        _, position, light, azimuth, camera = bracket
        if position in self.terrain_rocks.unverified:
            return None
        olat_images = [self._olat_image(position, camera, azimuth)] if azimuth != NO_SUN else []
        if light == "on" and (rig_lamp := self.terrain_rocks.world.rig_lamp):
            olat_images.append(rig_lamp.share * self._olat_image(position, camera, NO_SUN))
        rate = sum(olat_images, np.zeros(self._surface(position, camera).hit.shape, np.float32))
        return Brightness(rate.repeat(STEP_PX, axis=0).repeat(STEP_PX, axis=1), (), self._step)

    def _visible_surface(self, position: str, camera: CameraSide) -> VisibleSurface:
        world, view = self.terrain_rocks.world, self.terrain_rocks.localised[position].camera(camera)
        width, height = view.size
        columns, rows = (np.arange(STEP_PX / 2, length, STEP_PX) for length in (width, height))
        rays = sightlines(world, view, rows, columns)
        hit, directions = rays.hit, rays.directions[rays.hit]
        normals = self._normals[rays.face[hit]]
        away = (normals * directions).sum(axis=1) > 0
        points = view.centre + rays.distance[hit, None] * directions
        return VisibleSurface(hit.reshape(len(rows), len(columns)), points, np.where(away[:, None], -normals, normals))

    def _lit(self, position: str, camera: CameraSide, azimuth: Azimuth) -> np.ndarray:
        """Return grey values per millisecond (h, w) float32 under a Sun lamp or a rover light of equal intensity."""
        world, surface = self.terrain_rocks.world, self._surface(position, camera)
        lamp = active_lamp(world, self.terrain_rocks.localised[position], "on", azimuth)
        assert lamp is not None  # `brightness` skips a missing rig lamp
        to_lamp = lamp - surface.points
        cosine = np.einsum("nk,nk->n", surface.normals, to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True))
        facing = np.flatnonzero(cosine > 0)
        lit = facing[~world.everything.occluded(surface.points[facing], to_lamp[facing], 1.0)]
        if world.walls is not None:
            lit = lit[~world.walls.occluded(surface.points[lit], to_lamp[lit], 1.0)]
        light = SKY_SHARE / 2 * (1 + surface.normals[:, 2])
        light[lit] += cosine[lit]
        olat_image = np.zeros(surface.hit.shape, np.float32)
        olat_image[surface.hit] = self._scale * light
        return olat_image

    @cached_property
    def _normals(self) -> np.ndarray:
        """Unit normals (f, 3) of the faces of `World.everything`: terrain, then domes."""
        mesh = self.terrain_rocks.terrain
        corners = [mesh.vertices[mesh.faces]]
        for _, dome in sorted(self.terrain_rocks.domes.items()):
            vertices, faces = dome.mesh()
            corners.append(vertices[faces])
        a, b, c = np.concatenate(corners).swapaxes(0, 1)
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def _level_cosine(site: Site) -> float:
    """Return the cosine of incidence of the first Sun lamp at the centre; 1 without Sun lamps."""
    lamp = next(iter(site.lamps.values()), None)
    return 1.0 if lamp is None else float(lamp.point[2] / np.linalg.norm(lamp.point))

"""Edges of the shadows of walls on open sand: predicted from walls and lamps, and measured in photos.

1. `edge_profiles` predicts the edges by rays from a lamp over the tops of the walls, and places profiles on the sand
   across them, along the light.
2. `EdgeProfiles.measure` reads a photo along the profiles and locates the half-light point of each group.
3. `measure_edges` measures all photos of a terrain under a single Sun lamp.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.geometry.patches import NEARER, between_pixels
from polarsim.geometry.rays import Caster
from polarsim.geometry.shadow_edges import shadow_edge_offsets
from polarsim.photo import NO_ROCK, Terrain, by_bracket
from polarsim.run_files.brackets import read_rate
from polarsim.run_files.lamps import is_directional
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import SIDES, Side, Walls
from polarsim.site import Site

ALONG_STEP = 0.01  # distance between rays along the top of a wall, metres
AVERAGED = 20  # number of neighbouring profiles in a group, against the grain of the sand
STEP = 0.0025  # distance between the points of a profile, metres
REACH = 0.30  # maximum distance between predicted and measured edge, metres
PROFILE = 0.65  # half length of profiles, metres: reach, half width of the widest penumbra, and ground beyond it
SUN_RADIUS = 0.0047  # of a directional lamp such as the Sun, radians
LIFT = 0.004  # metres: start of shadow rays above the mesh, which noise would otherwise shade in grazing light
WALL_MARGIN = 0.04  # metres: folds of the cloth nearer to a wall, and height above the top of a near wall
BRIGHTEST_GREY = 250  # grey values of published photos above it may be clipped
MIN_SHOWN = 0.5  # minimum share of the profiles of a group that show a point

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class OpenGround:
    """Ray casters of a terrain without walls."""

    ground: Caster
    everything: Caster  # ground and rocks
    above: float  # height above all vertices, metres

    @classmethod
    def of(cls, terrain: TerrainMesh) -> OpenGround:
        """Build the casters of a terrain."""
        ground = terrain.faces[terrain.rock_of_face == NO_ROCK]
        return cls(
            make_caster(terrain.vertices, ground),
            make_caster(terrain.vertices, terrain.faces),
            float(terrain.vertices[:, 2].max()) + 1.0,
        )

    def points_at(self, level: np.ndarray) -> np.ndarray:
        """Return the points (n, 3) of the ground at level coordinates (n, 2); height NaN outside the mesh."""
        origins = np.column_stack([level, np.full(len(level), self.above)])
        distance, _ = self.ground.nearest(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
        return np.column_stack([level, np.where(np.isfinite(distance), self.above - distance, np.nan)])


@dataclass(frozen=True)
class EdgeSamples:
    """Measured points of the shadow edges of walls, one for each of n groups of profiles."""

    side: np.ndarray  # (n,) index into SIDES
    measured: np.ndarray  # (n, 3) on the ground, sandbox frame, metres
    offset_m: np.ndarray  # (n,) level distance from the predicted edge; positive: the shadow in the photo is longer
    offset_px: np.ndarray  # (n,) distance in the photo

    def __len__(self) -> int:
        return len(self.side)

    @staticmethod
    def joined(parts: Sequence[EdgeSamples]) -> EdgeSamples:
        """Concatenate samples."""
        none = EdgeSamples(np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
        names = [field.name for field in fields(EdgeSamples)]
        return EdgeSamples(*(np.concatenate([getattr(part, name) for part in (none, *parts)]) for name in names))


@dataclass(frozen=True)
class EdgeProfiles:
    """Profiles across the predicted shadow edges of a lamp: n groups of `AVERAGED` profiles of k points."""

    ground: OpenGround
    walls: Walls
    side: np.ndarray  # (n,) index into SIDES
    points: np.ndarray  # (n, AVERAGED, k, 3) on the ground, from the shadow to the light; NaN if not open sand
    penumbra: np.ndarray  # (n,) half width on the ground, metres

    def measure(self, rate: np.ndarray, camera: Camera) -> EdgeSamples:
        """Locate the edges in a linear photo (h, w); groups without a clear edge are omitted."""
        offset = shadow_edge_offsets(self._brightness(rate, camera), self.penumbra, STEP, REACH)
        found = np.flatnonzero(np.isfinite(offset))
        count = self.points.shape[2]
        line = _nanmean(self.points[found])  # (m, k, 3)
        at = np.clip(count // 2 + offset[found] / STEP, 0, count - 1.001)
        low, row = at.astype(int), np.arange(len(found))
        share = (at - low)[:, None]
        measured = (1 - share) * line[row, low] + share * line[row, low + 1]
        predicted = line[:, count // 2]
        off_px = np.linalg.norm(camera.project(measured) - camera.project(predicted), axis=1)
        kept = np.flatnonzero(np.isfinite(off_px))
        return EdgeSamples(self.side[found][kept], measured[kept], offset[found][kept], off_px[kept])

    def _brightness(self, rate: np.ndarray, camera: Camera) -> np.ndarray:
        """Return the median brightness (n, k) of the profiles of each group; NaN where few profiles are visible."""
        points = self.points.reshape(-1, 3)
        shown = np.flatnonzero(np.isfinite(points[:, 2]))
        pixels = camera.project(points[shown])
        above_wall = self.walls.clearance(points[shown], camera.centre) > WALL_MARGIN
        inside = camera.inside(pixels) & above_wall
        shown, pixels = shown[inside], pixels[inside]
        towards = points[shown] - camera.centre
        hidden = self.ground.everything.occluded(np.broadcast_to(camera.centre, towards.shape), towards, NEARER)
        values = np.full(len(points), np.nan)
        values[shown[~hidden]] = between_pixels(rate, pixels[~hidden])
        by_profile = values.reshape(self.points.shape[:-1])
        enough = np.isfinite(by_profile).mean(axis=1) >= MIN_SHOWN
        by_profile = np.where(enough[:, None], by_profile, 0.0)
        return np.where(enough, np.nanmedian(by_profile, axis=1), np.nan)


def edge_profiles(ground: OpenGround, walls: Walls, lamp: np.ndarray, radius_m: float) -> EdgeProfiles:
    """Place profiles across the shadow edges of all walls between the sand and a lamp (3,).

    `radius_m`: radius of the disc of the lamp, which determines the width of the penumbra.
    """
    numbers = [number for number, side in enumerate(SIDES) if side in walls.sides]
    parts = [_profiles_of_side(ground, walls, SIDES[number], lamp, radius_m) for number in numbers]
    side = np.repeat(numbers, [len(penumbra) for _, penumbra in parts])
    points, penumbra = (np.concatenate(of_sides) for of_sides in zip(*parts, strict=True))
    return EdgeProfiles(ground, walls, side, points, penumbra)


def _profiles_of_side(
    ground: OpenGround, walls: Walls, side: Side, lamp: np.ndarray, radius_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, AVERAGED, k, 3) and penumbra (n,) of the profiles of a wall; n is 0 for a lamp inside it."""
    wall, half = walls.sides[side], round(PROFILE / STEP)
    axis, sign = "xy".index(side[1]), -1.0 if side[0] == "-" else 1.0
    along = np.arange(wall.along_m[0], wall.along_m[-1], ALONG_STEP)
    groups = len(along) // AVERAGED if sign * lamp[axis] > wall.face_m else 0
    along = along[: groups * AVERAGED]
    tops = np.empty((len(along), 3))
    tops[:, axis], tops[:, 1 - axis], tops[:, 2] = sign * wall.face_m, along, wall.top(along)
    rays = tops - lamp
    distance, _ = ground.ground.nearest(tops, rays)  # relative to the distance of the top from the lamp
    distance = np.where(np.isfinite(distance), distance, np.nan)
    edges = tops + distance[:, None] * rays
    level = np.linalg.norm(rays[:, :2], axis=1)
    steps = np.arange(-half, half + 1) * STEP
    at = edges[:, None, :2] + steps[:, None] * (rays[:, :2] / level[:, None])[:, None]
    points = _on_open_sand(ground, walls, lamp, at.reshape(-1, 2)).reshape(groups, AVERAGED, 2 * half + 1, 3)
    # The disc faces the sand: its image on the ground is stretched by the inverse sine of the elevation.
    penumbra = radius_m * distance * np.linalg.norm(rays, axis=1) / -rays[:, 2]
    penumbra = penumbra.reshape(groups, AVERAGED).mean(axis=1)
    usable = np.isfinite(points[:, :, half, 2]).any(axis=1) & np.isfinite(penumbra)
    return points[usable], penumbra[usable]


def _on_open_sand(ground: OpenGround, walls: Walls, lamp: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return the ground (n, 3) at level coordinates (n, 2); NaN near walls and in the shadow of rocks and relief."""
    points = np.full((len(level), 3), np.nan)
    low, high = walls.bounds
    with np.errstate(invalid="ignore"):
        inside = np.flatnonzero(((level > low + WALL_MARGIN) & (level < high - WALL_MARGIN)).all(axis=1))
    found = ground.points_at(level[inside])
    inside, found = inside[np.isfinite(found[:, 2])], found[np.isfinite(found[:, 2])]
    lit = ~ground.everything.occluded(found + np.array([0.0, 0.0, LIFT]), lamp - found, 1.0)
    points[inside[lit]] = found[lit]
    return points


def _nanmean(points: np.ndarray) -> np.ndarray:
    """Return the mean (m, k, 3) of the known points of each group (m, AVERAGED, k, 3)."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Mean of empty slice", RuntimeWarning)
        return np.asarray(np.nanmean(points, axis=1))


def measure_edges(
    terrain: Terrain,
    ground: OpenGround,
    walls: Walls,
    photos: Path,
    localised: Mapping[str, LocalisedRig],
    suns: Mapping[str, np.ndarray],
    site: Site,
    drawn: Path | None = None,
) -> dict[str, EdgeSamples]:
    """Measure the shadow edges of walls in all photos of a terrain under a single Sun lamp, by azimuth.

    `photos`: `photos.parquet`, or a folder of published photos, whose drawn lines are in the masks of the folder
    `drawn`. Photos of positions without a confirmed pose are excluded.
    `suns`, azimuth -> (3,): positions of the Sun lamps.
    """
    masks = {} if drawn is None else pictures_at(drawn)
    pictures = {key: path for key, path in pictures_at(photos).items() if key.terrain == terrain}
    proven = {position for position, rig in localised.items() if not rig.unproven}
    profiles = {name: edge_profiles(ground, walls, lamp, disc_radius(lamp, site, name)) for name, lamp in suns.items()}
    parts: dict[str, list[EdgeSamples]] = {azimuth: [] for azimuth in suns}
    for (_, position, light, azimuth, camera), keys in by_bracket(pictures).items():
        if position not in proven or light == "on" or azimuth not in suns or not len(profiles[azimuth].side):
            continue
        if photos.is_dir():
            rate = _published(pictures[keys[0]], masks.get(keys[0]), localised[position].camera(camera))
        else:
            lens = localised[position].rig.lens(camera)
            paths = [(key.exposure_ms, pictures[key]) for key in keys]
            rate, _ = read_rate(paths, (lens.width, lens.height), "not used for the walls")
        if rate is not None:
            parts[azimuth].append(profiles[azimuth].measure(rate, localised[position].camera(camera)))
    return {azimuth: EdgeSamples.joined(of_sun) for azimuth, of_sun in parts.items()}


def disc_radius(lamp: np.ndarray, site: Site, name: str) -> float:
    """Return the radius of the disc of a lamp at a position (3,), metres."""
    return SUN_RADIUS * float(np.linalg.norm(lamp)) if is_directional(lamp) else site.lamps[name].radius_m


def _published(path: Path, drawn: Path | None, camera: Camera) -> np.ndarray | None:
    """Return the grey values (h, w) of a published photo, NaN where clipped or drawn; None for another camera.

    Its tone curve is unknown. An increasing curve moves the half-light point by a part of the penumbra at most.
    """
    grey = png.read_png(path)
    grey = grey if grey.ndim == 2 else grey[..., 0]
    if grey.dtype != np.uint8 or grey.shape != camera.lens.shape:
        log.warning("%s: not used for the walls, expected 8 bits and the size of a photo", path)
        return None
    unusable = grey > BRIGHTEST_GREY
    if drawn is not None:
        unusable |= png.read_png(drawn) > 0
    return np.where(unusable, np.nan, grey.astype(np.float32))

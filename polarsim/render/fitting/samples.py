"""Samples for fitting materials: photo pixels lit by a single lamp, with the geometry that a model needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import ndimage

from polarsim.geometry.camera import Camera
from polarsim.geometry.light_field import relative_irradiance
from polarsim.geometry.vectors import dot, length
from polarsim.render.fitting.exposures import Linear
from polarsim.render.hits import cast_strip, for_strips
from polarsim.render.lamps import REFERENCE_DISTANCE, Lamp
from polarsim.render.lighting import lighting
from polarsim.render.materials import Reflectance, hemispherical_albedo
from polarsim.render.optics import vignette
from polarsim.render.options import CHRONO, Model, RenderOptions
from polarsim.render.parameters import Parameters
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import GROUND, ROCK_IDS
from polarsim.run_files.walls import Origin, Walls

_MIN_COSINE = 0.06  # minimum cosine of incidence: at grazing light small errors of normals have a large effect
# Points that walls with this error could hide or shade are excluded.
_WALL_ERROR_M: dict[Origin, float] = {"scans": 0.03, "photos": 0.06, "survey": 0.15}
STEP_PX = 2  # every second pixel of a row and of a column of the ground is a sample; every pixel of rocks
BORDER_PX = 3  # pixels closer than this to the edge of an object or shadow are excluded: their light is mixed
_NOISE = 0.2  # maximum relative noise (standard deviation) of a sample


@dataclass(frozen=True)
class FitSamples:
    """Samples, n pairs of a pixel and a lamp; float32, sandbox frame."""

    lamp: np.ndarray  # (n,) int16 index into the names of lamps
    view: np.ndarray  # (n,) int16
    rate: np.ndarray  # (n,) DN per ms
    face: np.ndarray  # (n,) int32
    weights: np.ndarray  # (n, 2) barycentric
    point: np.ndarray  # (n, 3) metres
    normal: np.ndarray  # (n, 3) unit
    to_lamp: np.ndarray  # (n, 3) unit
    to_viewer: np.ndarray  # (n, 3) unit
    intensity: np.ndarray  # (n,) surveyed intensity of the lamp
    distance: np.ndarray  # (n,) metres to the lamp; `REFERENCE_DISTANCE` for lamps without falloff
    relative: np.ndarray  # (n,) irradiance of the light field of the lamp; 1 without field
    vignette: np.ndarray  # (n,) transmission of the lens if it vignettes

    def __len__(self) -> int:
        return len(self.lamp)

    def part(self, chosen: np.ndarray) -> FitSamples:
        """Return the samples chosen by a mask or by numbers."""
        return FitSamples(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @staticmethod
    def joined(parts: Sequence[FitSamples]) -> FitSamples:
        """Concatenate samples; at least one part is required."""
        return FitSamples(
            *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(FitSamples))
        )


@dataclass(frozen=True)
class Setting:
    """Everything that determines the radiance of samples except the albedo."""

    model: Model
    parameters: Parameters
    engine: Reflectance
    options: RenderOptions

    def radiance(self, samples: FitSamples) -> np.ndarray:
        """Return the radiance (n,) of the samples at unit albedo, as in OLAT images of `render_view` with the lens."""
        radiance = self.engine(self.parameters, samples.normal, samples.to_lamp, samples.to_viewer)
        radiance *= dot(samples.normal, samples.to_lamp) * samples.relative
        if self.options.falloff:
            radiance *= np.float32(REFERENCE_DISTANCE**2) / samples.distance**2
        if self.model not in CHRONO:
            albedo = hemispherical_albedo(self.parameters) / np.pi
            radiance += np.float32(self.options.bounce * albedo) * (1 + samples.normal[:, 2]) / np.float32(2)
            radiance += np.float32(self.options.ambient * albedo)
        radiance *= samples.intensity
        return radiance * samples.vignette if self.options.vignetting else radiance


def with_light_fields(
    samples: FitSamples, fields: Mapping[str, Sequence[float]], names: Sequence[str], reach_m: float
) -> FitSamples:
    """Return the samples under lamps with light fields of a reach, by name; `names`: see `samples_of_view`."""
    relative, distance = samples.relative.copy(), samples.distance.copy()
    for name, coefficients in fields.items():
        chosen = np.flatnonzero(samples.lamp == names.index(name))
        relative[chosen] = relative_irradiance(coefficients, samples.point.take(chosen, axis=0), reach_m)
        distance[chosen] = REFERENCE_DISTANCE  # the field includes the falloff
    return replace(samples, relative=relative, distance=distance)


def samples_of_view(
    surfaces: Surfaces,
    number: int,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    photos: Mapping[str, Linear],
    names: Sequence[str],
    threads: int = 1,
) -> list[FitSamples]:
    """Select the samples of a view by lamp: lit pixels away from edges, with low noise and not clipped.

    `number`: number of the view. `photos`: linear images of the view under each single lamp. `names`: names of all
    lamps, indexed by `FitSamples.lamp`.
    """
    lens, size = camera.lens, camera.lens.shape
    surfaces.prepare(shadows=False)
    ids = np.zeros(size, np.int32)
    lit = {name: np.zeros(size, bool) for name in photos}
    darkening = vignette(lens)
    by_strip: dict[tuple[str, int], tuple[np.ndarray, FitSamples]] = {}  # by lamp and first row

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, camera, rows)
        ids[rows].reshape(-1)[hits.pixel] = surfaces.id_of_face.take(hits.face)
        pixel = hits.pixel + rows.start * lens.width
        row, column = np.divmod(pixel, lens.width)
        on_grid = (row % STEP_PX == 0) & (column % STEP_PX == 0)
        on_grid |= ids[rows].reshape(-1)[hits.pixel] >= ROCK_IDS  # rocks are small
        on_grid &= clear_of_walls(hits.point, camera.centre, surfaces.walls)
        for name in photos:
            lamp = lamps[name]
            unit_lamp = Lamp(lamp.position)
            numbers, to_lamp, cosine = lighting(surfaces, hits, unit_lamp, falloff=False)
            lit[name][rows].reshape(-1)[hits.pixel[numbers]] = True
            kept = np.flatnonzero(on_grid[numbers] & (cosine > _MIN_COSINE))
            kept = kept[clear_of_walls(hits.point[numbers[kept]], lamp.position, surfaces.walls)]
            part, at, count = hits.part(numbers[kept]), pixel[numbers[kept]], len(kept)
            samples = FitSamples(
                np.full(count, names.index(name), np.int16),
                np.full(count, number, np.int16),
                photos[name].rate.reshape(-1)[at],
                part.face.astype(np.int32),
                part.weights.astype(np.float32),
                part.point,
                part.normal,
                to_lamp[kept].astype(np.float32),
                part.to_viewer,
                np.full(count, lamp.intensity, np.float32),
                _distance(lamp, part.point),
                np.ones(count, np.float32),
                darkening.reshape(-1)[at],
            )
            by_strip[name, rows.start] = at, samples

    for_strips(lens.height, threads, work)
    window = 2 * BORDER_PX + 1
    inside = (ndimage.minimum_filter(ids, window) == ndimage.maximum_filter(ids, window)) & (ids >= GROUND)
    parts = []
    for name, start in sorted(by_strip, key=lambda key: (names.index(key[0]), key[1])):
        at, samples = by_strip[name, start]
        if start == 0:
            photo = photos[name]
            sharp = photo.variance < (_NOISE * photo.rate) ** 2
            good = inside & sharp & (photo.rate > 0) & ndimage.minimum_filter(lit[name], window)
        parts.append(samples.part(good.reshape(-1)[at]))
    return parts


def _distance(lamp: Lamp, points: np.ndarray) -> np.ndarray:
    """Return `FitSamples.distance` (n,) of points (n, 3)."""
    if lamp.distant:
        return np.full(len(points), REFERENCE_DISTANCE, np.float32)
    return length(lamp.position.astype(np.float32) - points)


def clear_of_walls(points: np.ndarray, towards: np.ndarray, walls: Walls | None) -> np.ndarray:
    """Return which points (n,) are inside the sandbox and have a path to a point (3,) well above the walls."""
    if walls is None:
        return np.ones(len(points), bool)
    nominal = any(wall.support == 0 for wall in walls.sides.values())  # scans of other sides do not help
    margin = _WALL_ERROR_M["survey" if nominal else walls.origin]
    low, high = walls.bounds
    inside = ((points[:, :2] > low + margin) & (points[:, :2] < high - margin)).all(axis=1)
    return np.asarray(inside & (walls.clearance(points, towards) > margin))

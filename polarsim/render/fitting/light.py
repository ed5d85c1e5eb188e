"""Fit of the light fields of the Sun lamps to the photos of all terrains, with tests on left-out terrains.

The lamps of a laboratory are the same for all terrains. Over several terrains and views, relief and albedo average out,
and what remains of photo over twin is the beam of the lamp.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.geometry.light_field import EVEN, POWERS, REACH_M, relative_irradiance, terms
from polarsim.photo import NO_ROCK, NO_SUN, PositionCamera, Terrain
from polarsim.render.fitting.exposures import read_published_photo
from polarsim.render.fitting.samples import FitSamples, Setting
from polarsim.render.fitting.terrain import median_stops, samples_of_scene, samples_of_terrain
from polarsim.render.lamps import REFERENCE_DISTANCE, ROVER, field_reach_m, lamp_names
from polarsim.render.models import Domain, model_of
from polarsim.render.olat import reflectance_engine
from polarsim.render.options import RenderOptions
from polarsim.run_files.light_fields import FittedField, write_light_fields
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.site import Site

log = logging.getLogger("polarsim.render")

_SCALE = 0.25  # scale of the photos: the field is smooth
_MAX_SAMPLES = 20_000  # per terrain and lamp
_MIN_SAMPLES = 1000  # of a lamp
_ROUNDS = 15
_MIN_SCATTER = 0.03  # minimum scatter of the residuals, natural logarithm
_CAUCHY_SCALE = 2.5  # scale of the Cauchy weight, in units of the scatter
_KINDS = ("even", "inverse_square", "field")  # of compared light
_RIDGE = 1e-3  # weight of a field of 1, per observation: parts of the sand may be invisible or in shadow


@dataclass(frozen=True)
class PhotoOverTwin:
    """Photo over twin on the ground of a terrain under one lamp, n samples."""

    point: np.ndarray  # (n, 2) sandbox frame, metres
    ratio: np.ndarray  # (n,) natural logarithm, for a lamp without falloff
    falloff: np.ndarray  # (n,) natural logarithm of the inverse square of the distance
    view: np.ndarray  # (n,)
    positions: tuple[str, ...]  # of the views

    def stops(self, field: np.ndarray | float) -> float:
        """Return `median_stops` of photo over twin; `field` (n,): logarithm of the irradiance."""
        return median_stops(self.ratio - field, self.view)


def fit_light(
    *,
    site: Site,
    cameras: Mapping[Terrain, Path],
    meshes: Mapping[Terrain, Path],
    photos: Sequence[Path],
    domains: Sequence[Domain],
    light: Mapping[Terrain, Path],
    options: RenderOptions,
    threads: int,
) -> None:
    """Fit the light fields of every domain of twins; write a file per terrain.

    `cameras`, `meshes`: folders of each terrain. `photos`: tables `photos.parquet`, or a folder of published photos.

    A terrain has one or two published photos. The fields of a terrain are fitted to those of other terrains only, so
    that all of them remain tests of its twins.
    """
    engine, options = reflectance_engine(options, threads), options.as_fitted()
    found: dict[Terrain, tuple[TerrainMesh, FitSamples, list[PositionCamera]]] = {}
    paths = {key: path for source in photos for key, path in pictures_at(source).items()}
    published = not all(source.suffix == ".parquet" for source in photos)
    read, held_out = (
        (read_published_photo, frozenset(site.suns))
        if published
        else (png.read_photo, frozenset({options.fitting.held_out or NO_SUN}))
    )
    names = lamp_names(site)
    for terrain in sorted({key.terrain for key in paths} & set(light)):
        sandbox = site.sandbox_of(terrain)
        mesh = read_terrain(meshes[terrain], terrain, sandbox, cameras=cameras[terrain])
        samples = samples_of_terrain(site, terrain, cameras[terrain], mesh, paths, options, threads, _SCALE, read)
        if samples is not None:
            of_scene = samples[0] if published else samples_of_scene(terrain, samples[0], names)
            found[terrain] = mesh, of_scene, samples[1]
    found = {terrain: part for terrain, part in found.items() if len(part[1])}
    fields: dict[Terrain, dict[str, dict[str, FittedField]]] = {terrain: {} for terrain in light}
    for domain in domains:
        model = model_of(domain)
        setting = Setting(model, options.parameters(model), engine, options.model_copy(update={"falloff": False}))
        seen = {
            terrain: photo_over_twin(samples, names, mesh, setting, views)
            for terrain, (mesh, samples, views) in found.items()
        }
        for terrain, of_terrain in light_fields(seen, set(light), held_out, site.suns, field_reach_m(site)).items():
            fields[terrain][domain] = of_terrain
    if not any(fields[terrain].get(domain) for terrain in light for domain in domains):
        log.warning("no light field: no fitted photo shows lit sand (azimuth %s of a terrain is held out); lamps have "
                    "even light", options.fitting.held_out or NO_SUN)  # fmt: skip
    for terrain, path in light.items():
        write_light_fields(path, fields[terrain])


def photo_over_twin(
    samples: FitSamples, names: Sequence[str], mesh: TerrainMesh, setting: Setting, views: Sequence[PositionCamera]
) -> dict[str, PhotoOverTwin]:
    """Return photo over twin on the ground by Sun lamp; lamps with few samples are omitted.

    `names`, `views`: names of the lamps, and views, indexed by `FitSamples.lamp` and `FitSamples.view`.
    """
    ground = mesh.rock_of_face.take(samples.face) == NO_ROCK
    found: dict[str, PhotoOverTwin] = {}
    for number, name in enumerate(names):
        if name == ROVER:
            continue
        chosen = np.flatnonzero(ground & (samples.lamp == number))
        part = samples.part(chosen[:: -(-len(chosen) // _MAX_SAMPLES) or 1])
        radiance = setting.radiance(part)
        part, radiance = part.part(radiance > 0), radiance[radiance > 0]
        if len(part) < _MIN_SAMPLES:
            continue
        falloff = 2 * np.log(REFERENCE_DISTANCE / part.distance.astype(float))
        point = part.point[:, :2].astype(float)
        positions = tuple(sorted({views[view][0] for view in np.unique(part.view).tolist()}))
        found[name] = PhotoOverTwin(point, np.log(part.rate.astype(float) / radiance), falloff, part.view, positions)
    return found


def light_fields(
    seen: Mapping[Terrain, Mapping[str, PhotoOverTwin]],
    terrains: Set[Terrain],
    held_out: Set[str],
    suns: Sequence[str],
    reach_m: float = REACH_M,
) -> dict[Terrain, dict[str, FittedField]]:
    """Return the fields of every terrain by azimuth, from photo over twin by terrain and azimuth.

    The field of an azimuth is even if, on left-out terrains, the median error of a fitted field is not lower. The
    photos of a terrain under the held-out azimuths do not affect its fields. Azimuths without photos are omitted.
    """
    fields: dict[Terrain, dict[str, FittedField]] = {terrain: {} for terrain in terrains}
    for azimuth in suns:
        parts = {terrain: by_lamp[azimuth] for terrain, by_lamp in sorted(seen.items()) if azimuth in by_lamp}
        if not parts:
            continue
        everywhere = fit_field(list(parts.values()), reach_m)
        others = {
            terrain: fit_field([part for other, part in parts.items() if other != terrain], reach_m)
            for terrain in terrains
            if set(parts) - {terrain}
        }
        errors = {
            terrain: {
                "even": part.stops(0.0),
                "inverse_square": part.stops(part.falloff),
                "field": part.stops(np.log(relative_irradiance(others[terrain], part.point, reach_m))),
            }
            for terrain, part in parts.items()
            if terrain in others
        }
        if errors:
            medians = {kind: float(np.median([error[kind] for error in errors.values()])) for kind in _KINDS}
            used = medians["field"] < medians["even"]
            log.info(
                "light field of azimuth %s%s: median error on left-out terrains %.3f stops, inverse square %.3f, "
                "even %.3f",
                azimuth, "" if used else ": even", medians["field"], medians["inverse_square"], medians["even"],
            )  # fmt: skip
            if not used:
                everywhere, others = EVEN, dict.fromkeys(others, EVEN)
        for terrain in terrains:
            if azimuth not in held_out:
                field, fitted = everywhere, tuple(parts)
            elif terrain in others:
                field, fitted = others[terrain], tuple(other for other in parts if other != terrain)
            else:
                continue
            positions = parts[terrain].positions if terrain in fitted else ()
            fields[terrain][azimuth] = FittedField(
                coefficients=field, terrains=fitted, positions=positions, held_out_stops=errors.get(terrain, {})
            )
    return fields


def fit_field(parts: Sequence[PhotoOverTwin], reach_m: float = REACH_M) -> tuple[float, ...]:
    """Fit a field to photo over twin of terrains, with a free brightness of every view, by Cauchy weights."""
    groups = [part.view + 1000 * number for number, part in enumerate(parts)]
    _, group = np.unique(np.concatenate(groups), return_inverse=True)
    of_field = np.concatenate([terms(part.point, reach_m) for part in parts])
    ratio = np.concatenate([part.ratio for part in parts])
    design = np.concatenate([of_field, group[:, None] == np.arange(group.max() + 1)], axis=1)
    pull = np.zeros(design.shape[1])
    pull[: len(POWERS)] = _RIDGE * len(ratio)
    weight = np.ones(len(ratio))
    for _ in range(_ROUNDS):
        weighted = design * weight[:, None]
        # einsum instead of BLAS, whose results depend on the number of threads
        normal = np.einsum("ni,nj->ij", weighted, design)
        solution = np.linalg.solve(normal + np.diag(pull), np.einsum("ni,n->i", weighted, ratio))
        residual = ratio - np.einsum("ni,i->n", design, solution)
        scatter = max(1.4826 * float(np.median(np.abs(residual))), _MIN_SCATTER)
        weight = 1 / (1 + (residual / (_CAUCHY_SCALE * scatter)) ** 2)
    return tuple(float(f"{value:.5g}") for value in solution[: len(POWERS)])

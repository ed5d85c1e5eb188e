"""Fit of the materials of a terrain to photos, with validation on held-out photos; reads and writes files."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.geometry.light_field import REACH_M
from polarsim.photo import NO_SUN, Terrain, terrain_text
from polarsim.randomness import generator
from polarsim.render.fitting.samples import FitSamples, Setting, with_light_fields
from polarsim.render.fitting.search import cells_of, fitted_parameters
from polarsim.render.fitting.terrain import lamps_in, samples_of_scene, samples_of_terrain
from polarsim.render.fitting.texels import Solution, Texels, solve, texels_of
from polarsim.render.lamps import field_reach_m, lamp_names
from polarsim.render.materials import Reflectance, between_corners
from polarsim.render.models import Domain, model_of
from polarsim.render.olat import reflectance_engine
from polarsim.render.options import RenderOptions
from polarsim.run_files.light_fields import read_light_fields, sun_coefficients
from polarsim.run_files.materials import FittedMaterial, FittedMaterials, rock_of_vertex, write_materials
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.site import Site

log = logging.getLogger("polarsim.render")

Coefficients = Mapping[Domain, Mapping[str, Sequence[float]]]  # light fields by domain and lamp


def fit_materials(
    *,
    site: Site,
    terrain: Terrain,
    cameras: Path,
    meshes: Path,
    photos: Path | None,
    light: Path | None,
    domains: Sequence[Domain],
    materials: Path,
    options: RenderOptions,
    threads: int,
) -> None:
    """Fit the materials and write the folder `materials`; without usable photos log a warning and write an empty fit.

    `cameras`, `meshes`: folders of the terrain. `photos`: `photos.parquet`, may be empty. `light`: light fields.
    """
    mesh, names = read_terrain(meshes, terrain, site.sandbox_of(terrain), cameras=cameras), lamp_names(site)
    reach = field_reach_m(site)
    paths = pictures_at(photos) if photos else {}
    found = samples_of_terrain(site, terrain, cameras, mesh, paths, options, threads)
    engine = reflectance_engine(options, threads)
    light_fields = read_light_fields(light) if light else {}
    fields = {domain: sun_coefficients(light_fields.get(domain, {}), site.suns) for domain in domains}
    samples = samples_of_scene(terrain, found[0], names) if found else None
    fitted = (
        fit(samples, names, mesh, domains, engine, options.as_fitted(), fields, options, reach) if samples else None
    )
    if fitted is None or found is None:
        log.warning("terrain %s: no fitted photo shows lit surfaces (azimuth %s is held out); twins have "
                    "constant materials", terrain_text(terrain), options.fitting.held_out or NO_SUN)  # fmt: skip
        fitted = FittedMaterials({}, np.zeros(len(mesh.vertices), np.int64))
    else:
        fitted = replace(fitted, positions=tuple(dict.fromkeys(position for position, _ in found[1])))
    write_materials(materials, mesh, fitted)


def fit(
    samples: FitSamples,
    names: Sequence[str],
    mesh: TerrainMesh,
    domains: Sequence[Domain],
    engine: Reflectance,
    options: RenderOptions,
    fields: Coefficients | None = None,
    plain: RenderOptions | None = None,
    reach_m: float = REACH_M,
) -> FittedMaterials | None:
    """Fit the materials of every domain of twins to the samples; None if there are too few samples.

    The photos of the held-out azimuth affect only the brightness of its lamp. `names`: names of the lamps, indexed by
    `FitSamples.lamp`. `fields`: light fields of the lamps, of a reach.
    `plain`: options of twins without fit, for the comparison; None: `options`.
    """
    held_out = names.index(options.fitting.held_out) if options.fitting.held_out in names else -1
    fitted: dict[str, FittedMaterial] = {}
    observations = np.zeros(len(mesh.vertices), np.int64)
    for domain in domains:
        model = model_of(domain)
        lit = with_light_fields(samples, (fields or {}).get(domain, {}), names, reach_m)
        cells = cells_of(lit.part(lit.lamp != held_out), generator(options.seed, "materials"))
        if cells is None:
            return None
        start = options.parameters(model)
        if len(np.unique(cells.lamp)) > 1:
            parameters = fitted_parameters(cells, Setting(model, start, engine, options))
        else:
            log.warning(
                "%s: photos of a single lamp do not determine parameters, those of the options are used", domain
            )
            parameters = start
        after = Setting(model, parameters, engine, options)
        before = Setting(model, start, engine, plain or options)
        texels = texels_of(lit, after.radiance(lit), mesh.faces)
        held = texels.lamp == held_out
        training = texels.part(~held)
        solution = solve(training, mesh.faces, rock_of_vertex(mesh))
        check = {}
        if held.any() and not held.all():
            rest = texels.part(held)
            brightness = float(np.median(rest.ratio - solution.albedo[rest.vertex]))
            check = _check(samples, lit, training, solution, before, after, mesh, held_out)
            solution = replace(solution, lamps=dict(sorted({**solution.lamps, held_out: brightness}.items())))
        fitted[domain] = FittedMaterial(
            parameters.model_dump(mode="json"),
            {names[number]: float(np.exp(gain)) for number, gain in solution.lamps.items()},
            {rock: float(np.exp(mean)) for rock, mean in solution.rocks.items()},
            np.exp(solution.albedo).astype(np.float32),
            check,
        )
        observations = np.bincount(training.vertex, minlength=len(mesh.vertices))
        log.info("%s: %s, lamps %s, %s", domain, parameters, fitted[domain].lamps, check)
    return FittedMaterials(fitted, observations, lamps_in(samples.part(samples.lamp != held_out), names))


def _check(
    plain: FitSamples,
    lit: FitSamples,
    training: Texels,
    solution: Solution,
    before: Setting,
    after: Setting,
    mesh: TerrainMesh,
    held_out: int,
) -> dict[str, Any]:
    """Return the errors under the held-out lamp, fitting only its brightness; empty if it shows no fitted surface.

    `plain`, `lit`: samples without and with light fields.
    """
    observed = np.bincount(training.vertex, minlength=len(mesh.vertices)) > 0
    chosen = np.flatnonzero(lit.lamp == held_out)
    chosen = chosen[observed[mesh.faces.take(lit.face.take(chosen), axis=0)].all(axis=1)]
    if not len(chosen):
        return {}
    test = lit.part(chosen)
    constant, unfitted = after.radiance(test), before.radiance(plain.part(chosen))
    corners = mesh.faces.take(test.face, axis=0)
    albedo = between_corners(solution.albedo.astype(np.float32), corners, test.weights)
    ratio = np.log(test.rate / constant)
    by_texel = texels_of(test, constant, mesh.faces)
    return {
        "azimuth": after.options.fitting.held_out,
        "pixels": compare_fits(np.log(test.rate / unfitted), ratio, ratio - albedo),
        "texels": compare_fits(
            texels_of(test, unfitted, mesh.faces).ratio,
            by_texel.ratio,
            by_texel.ratio - solution.albedo[by_texel.vertex],
        ),
    }


def errors(ratio: np.ndarray) -> dict[str, float]:
    """Return median absolute value and RMS, in stops, of log ratios (n,) of photo and twin around their median."""
    stops = (ratio - np.median(ratio)) / np.log(2)
    values = {"median_stops": np.median(np.abs(stops)), "rms_stops": np.sqrt(np.mean(stops * stops))}
    return {name: float(f"{value:.5g}") for name, value in values.items()}


def compare_fits(before: np.ndarray, constant: np.ndarray, fitted: np.ndarray) -> dict[str, Any]:
    """Return the errors of twins without fit, with a fit except albedo, and with the full fit; log ratios (n,)."""
    named = {"unfitted": before, "constant_albedo": constant, "fitted": fitted}
    return {"count": len(fitted), **{name: errors(ratio) for name, ratio in named.items()}}

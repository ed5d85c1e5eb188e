"""Fit of the materials of a terrain to photos, with validation on held-out photos; reads and writes files."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.photo import SUNS, PhotoKey, PositionCamera
from polarsim.progress import track
from polarsim.randomness import generator
from polarsim.render.fitting.exposures import single_lamps
from polarsim.render.fitting.samples import Darkening, FitSamples, Setting, samples_of_view
from polarsim.render.fitting.search import cells_of, fitted_models
from polarsim.render.fitting.texels import Texels, solve, texels_of
from polarsim.render.lamps import ROVER, lamps_of_rig
from polarsim.render.materials import Reflectance, between_corners
from polarsim.render.olat import reflectance_engine
from polarsim.render.options import Model, RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.materials import FittedMaterial, FittedMaterials, rock_of_vertex, write_materials
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain

log = logging.getLogger("polarsim.render")

LAMPS = (*SUNS, ROVER)


def fit_materials(
    *,
    terrain: int,
    cameras: Path,
    meshes: Path,
    photos: Path | None,
    models: Sequence[Model],
    materials: Path,
    options: RenderOptions,
    threads: int,
) -> None:
    """Fit the materials and write the folder `materials`; without usable photos log a warning and write an empty fit.

    `cameras`, `meshes`: folders of the terrain. `photos`: `photos.parquet`, may be empty.
    """
    mesh = read_terrain(meshes, terrain, cameras=cameras)
    samples = _samples_of_terrain(terrain, cameras, mesh, photos, options, threads)
    engine = reflectance_engine(options, threads)
    fitted = None if samples is None else fit(samples, mesh, models, engine, options)
    if fitted is None:
        log.warning("terrain %02d: no photo shows lit surfaces; twins are rendered with constant materials", terrain)
        fitted = FittedMaterials(options.falloff, options.vignetting, {}, np.zeros(len(mesh.vertices), np.int64))
    write_materials(materials, mesh, fitted)


def fit(
    samples: FitSamples, mesh: TerrainMesh, models: Sequence[Model], engine: Reflectance, options: RenderOptions
) -> FittedMaterials | None:
    """Fit the materials to the samples under every model; None if there are too few samples.

    Model parameters, falloff and vignetting are fitted without the held-out azimuth. Albedo and lamps are first fitted
    without the held-out azimuth, for validation, and finally to all samples.
    """
    held_out = LAMPS.index(options.fitting.held_out) if options.fitting.held_out != "no" else -1
    training = samples.part(samples.lamp != held_out)
    cells = cells_of(training, generator(options.seed, "materials"))
    if cells is None:
        return None
    start = {model: options.parameters(model) for model in models}
    darkening, parameters = fitted_models(cells, start, engine, options)
    fitted: dict[str, FittedMaterial] = {}
    observations = np.zeros(len(mesh.vertices), np.int64)
    for model, fitted_parameters in parameters.items():
        after = Setting(model, fitted_parameters, darkening, engine, options)
        before = Setting(model, start[model], Darkening(options.falloff, options.vignetting), engine, options)
        texels = texels_of(samples, after.radiance(samples), mesh.faces)
        check = _check(samples, texels, before, after, mesh, held_out)
        solution = solve(texels, mesh.faces, rock_of_vertex(mesh))
        fitted[model] = FittedMaterial(
            fitted_parameters.model_dump(mode="json"),
            {LAMPS[number]: float(np.exp(gain)) for number, gain in solution.lamps.items()},
            {rock: float(np.exp(mean)) for rock, mean in solution.rocks.items()},
            np.exp(solution.albedo).astype(np.float32),
            check,
        )
        observations = np.bincount(texels.vertex, minlength=len(mesh.vertices))
        log.info("%s: %s, lamps %s, %s", model, fitted_parameters, fitted[model].lamps, check)
    return FittedMaterials(darkening.falloff, darkening.vignetting, fitted, observations)


def _check(
    samples: FitSamples, texels: Texels, before: Setting, after: Setting, mesh: TerrainMesh, held_out: int
) -> dict[str, Any]:
    """Return the errors under the held-out lamp, fitting only its brightness; empty without held-out lamp."""
    held = texels.lamp == held_out
    if not held.any() or held.all():
        return {}
    solution = solve(texels.part(~held), mesh.faces, rock_of_vertex(mesh))
    observed = np.bincount(texels.vertex[~held], minlength=len(mesh.vertices)) > 0
    test = samples.part(samples.lamp == held_out)
    test = test.part(observed[mesh.faces.take(test.face, axis=0)].all(axis=1))
    if not len(test):
        return {}
    constant, unfitted = after.radiance(test), before.radiance(test)
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


def _samples_of_terrain(
    terrain: int, cameras: Path, mesh: TerrainMesh, photos: Path | None, options: RenderOptions, threads: int
) -> FitSamples | None:
    """Return the samples of all views with a proven pose; None without samples."""
    rigs = read_all_localised(cameras)
    suns = read_suns(cameras, rigs)
    surfaces = build_surfaces(mesh, options)
    paths: dict[PositionCamera, dict[PhotoKey, Path]] = {}
    for key, path in (pictures_at(photos) if photos else {}).items():
        if key.terrain == terrain and path.is_file():
            paths.setdefault((key.position, key.camera), {})[key] = path
    views = [view for view in sorted(paths) if view[0] in rigs and not rigs[view[0]].unproven]
    parts: list[FitSamples] = []
    for number, view in enumerate(track(views, f"photos of terrain {terrain:02d}")):
        rig = rigs[view[0]]
        camera, lamps = rig.camera(view[1]), lamps_of_rig(suns, rig)
        photos_of_lamp = single_lamps(paths[view], camera.lens)
        parts += samples_of_view(surfaces, number, camera, lamps, photos_of_lamp, LAMPS, threads)
    parts = [part.part(part.face < len(mesh.faces)) for part in parts]  # excludes skirts
    samples = FitSamples.joined(parts) if parts else None
    return samples if samples is not None and len(samples) else None


def errors(ratio: np.ndarray) -> dict[str, float]:
    """Return median absolute value and RMS, in stops, of log ratios (n,) of photo and twin around their median."""
    stops = (ratio - np.median(ratio)) / np.log(2)
    values = {"median_stops": np.median(np.abs(stops)), "rms_stops": np.sqrt(np.mean(stops * stops))}
    return {name: float(f"{value:.5g}") for name, value in values.items()}


def compare_fits(before: np.ndarray, constant: np.ndarray, fitted: np.ndarray) -> dict[str, Any]:
    """Return the errors of twins without fit, with a fit except albedo, and with the full fit; log ratios (n,)."""
    named = {"unfitted": before, "constant_albedo": constant, "fitted": fitted}
    return {"count": len(fitted), **{name: errors(ratio) for name, ratio in named.items()}}

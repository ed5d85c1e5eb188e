"""Materials of a terrain from its photos, files to files, checked on photos that they were not fitted to."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.photo import SUNS, PhotoKey, PositionCamera
from polarsim.progress import track
from polarsim.randomness import generator
from polarsim.render.fitting.exposures import single_lamps
from polarsim.render.fitting.samples import Darkening, Samples, Setting, samples_of_view
from polarsim.render.fitting.search import cells_of, fitted_models
from polarsim.render.fitting.texels import Texels, solve, texels_of
from polarsim.render.lamps import ROVER, lamps_of
from polarsim.render.materials import Reflectance, between_corners
from polarsim.render.olat import reflectance_engine
from polarsim.render.options import Model, RenderOptions
from polarsim.render.surfaces import surfaces_of
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.materials import Fitted, FittedMaterials, rock_of_vertex, write_materials
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
    """Write the folder `materials`; without photos that show lit surfaces a warning, and a folder that fits nothing.

    Parameters
    ----------
    cameras : Path
        Folder with the terrain's `PosX.json`.
    meshes : Path
        Folder with the terrain's meshes.
    photos : Path or None
        `photos.parquet`; it may have no row.

    Raises
    ------
    FormatError
        A mesh, pose or table is missing or broken.
    RenderError
        The engine cannot be loaded.
    """
    mesh, options = read_terrain(meshes, terrain), options.of(terrain)
    samples = _samples_of_terrain(terrain, cameras, mesh, photos, options, threads)
    engine = reflectance_engine(options, threads)
    found = None if samples is None else fit(samples, mesh, models, engine, options)
    if found is None:
        log.warning("terrain %02d: no photo shows lit surfaces, its twins have constant materials", terrain)
        found = FittedMaterials(options.falloff, options.vignetting, {}, np.zeros(len(mesh.vertices), np.int64))
    write_materials(materials, mesh, found)


def fit(
    samples: Samples, mesh: TerrainMesh, models: Sequence[Model], engine: Reflectance, options: RenderOptions
) -> FittedMaterials | None:
    """What explains the samples best under every model; None where they are too few.

    Parameters of the models, falloff and vignetting come from samples without the azimuth that is held out; albedo and
    lamps, once they are checked on that, from all.
    """
    held_out = LAMPS.index(options.fitting.held_out) if options.fitting.held_out != "no" else -1
    known = samples.part(samples.lamp != held_out)
    cells = cells_of(known, generator(options.seed, "materials"))
    if cells is None:
        return None
    start = {model: options.parameters(model) for model in models}
    darkening, parameters = fitted_models(cells, start, engine, options)
    fitted: dict[str, Fitted] = {}
    looks = np.zeros(len(mesh.vertices), np.int64)
    for model, own in parameters.items():
        after = Setting(model, own, darkening, engine, options)
        before = Setting(model, start[model], Darkening(options.falloff, options.vignetting), engine, options)
        texels = texels_of(samples, after.radiance(samples), mesh.faces)
        check = _check(samples, texels, before, after, mesh, held_out)
        solution = solve(texels, mesh.faces, rock_of_vertex(mesh))
        fitted[model] = Fitted(
            own.model_dump(mode="json"),
            {LAMPS[number]: float(np.exp(gain)) for number, gain in solution.lamps.items()},
            {rock: float(np.exp(mean)) for rock, mean in solution.rocks.items()},
            np.exp(solution.albedo).astype(np.float32),
            check,
        )
        looks = np.bincount(texels.vertex, minlength=len(mesh.vertices))
        log.info("%s: %s, lamps %s, %s", model, own, fitted[model].lamps, check)
    return FittedMaterials(darkening.falloff, darkening.vignetting, fitted, looks)


def _check(
    samples: Samples, texels: Texels, before: Setting, after: Setting, mesh: TerrainMesh, held_out: int
) -> dict[str, Any]:
    """Errors under the lamp that was held out, whose brightness alone is taken from its photos; none without it."""
    held = texels.lamp == held_out
    if not held.any() or held.all():
        return {}
    solution = solve(texels.part(~held), mesh.faces, rock_of_vertex(mesh))
    seen = np.bincount(texels.vertex[~held], minlength=len(mesh.vertices)) > 0
    own = samples.part(samples.lamp == held_out)
    own = own.part(seen[mesh.faces.take(own.face, axis=0)].all(axis=1))
    if not len(own):
        return {}
    constant, unfitted = after.radiance(own), before.radiance(own)
    corners = mesh.faces.take(own.face, axis=0)
    albedo = between_corners(solution.albedo.astype(np.float32), corners, own.weights)
    ratio = np.log(own.rate / constant)
    by_texel = texels_of(own, constant, mesh.faces)
    return {
        "azimuth": after.options.fitting.held_out,
        "pixels": compared(np.log(own.rate / unfitted), ratio, ratio - albedo),
        "texels": compared(
            texels_of(own, unfitted, mesh.faces).ratio,
            by_texel.ratio,
            by_texel.ratio - solution.albedo[by_texel.vertex],
        ),
    }


def _samples_of_terrain(
    terrain: int, cameras: Path, mesh: TerrainMesh, photos: Path | None, options: RenderOptions, threads: int
) -> Samples | None:
    """Of all views whose position has a proven pose; None without any."""
    rigs = read_all_localised(cameras)
    suns = read_suns(cameras, rigs)
    surfaces = surfaces_of(mesh, options)
    paths = _paths_by_view(terrain, photos)
    views = [view for view in sorted(paths) if view[0] in rigs and not rigs[view[0]].unproven]
    parts: list[Samples] = []
    for number, view in enumerate(track(views, f"photos of terrain {terrain:02d}")):
        rig = rigs[view[0]]
        camera, lamps = rig.camera(view[1]), lamps_of(suns, rig)
        photos_of_lamp = single_lamps(paths[view], camera.lens)
        parts += samples_of_view(surfaces, number, camera, lamps, photos_of_lamp, LAMPS, options, threads)
    parts = [part.part(part.face < len(mesh.faces)) for part in parts]  # without feet that are drawn out
    samples = Samples.joined(parts) if parts else None
    return samples if samples is not None and len(samples) else None


def _paths_by_view(terrain: int, photos: Path | None) -> Mapping[PositionCamera, Mapping[PhotoKey, Path]]:
    if photos is None:
        return {}
    found: dict[PositionCamera, dict[PhotoKey, Path]] = {}
    for key, path in pictures_at(photos).items():
        if key.terrain == terrain and path.is_file():
            found.setdefault((key.position, key.camera), {})[key] = path
    return found


def errors(ratio: np.ndarray) -> dict[str, float]:
    """Of logarithms (n,) of photo over twin, one brightness taken out: median absolute value and RMS, in stops."""
    stops = (ratio - np.median(ratio)) / np.log(2)
    return {
        "median_stops": _rounded(float(np.median(np.abs(stops)))),
        "rms_stops": _rounded(float(np.sqrt(np.mean(stops * stops)))),
    }


def compared(before: np.ndarray, constant: np.ndarray, fitted: np.ndarray) -> dict[str, Any]:
    """Errors of twins without a fit, with all of it but the albedo, and with all of it; (n,) logarithms each."""
    return {
        "count": len(fitted),
        "unfitted": errors(before),
        "constant_albedo": errors(constant),
        "fitted": errors(fitted),
    }


def _rounded(value: float) -> float:
    return float(f"{value:.5g}")

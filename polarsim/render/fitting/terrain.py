"""Samples of all photos of a terrain, for the fits of light and materials; check that photos show the scene."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.geometry.vectors import dot
from polarsim.photo import PhotoKey, PositionCamera, Terrain, terrain_text
from polarsim.progress import track
from polarsim.render.fitting.exposures import Reader, single_lamps
from polarsim.render.fitting.samples import FitSamples, samples_of_view
from polarsim.render.lamps import ROVER, lamp_names, lamps_of_rig
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import Site

log = logging.getLogger("polarsim.render")
# Maximum difference between photos and a scene of constant albedo in even light (`median_stops`). Photos of the analog
# have 0.25 to 0.63; those of other terrains or under other lamps 0.45 to 1.8, more than 0.75 in 20 of 38 cases. Own
# cover photos have up to 0.94 (the crater of terrain 11), because the meshes of a release have smooth ground.
MAX_STOPS = 0.75


def samples_of_terrain(
    site: Site,
    terrain: Terrain,
    cameras: Path,
    mesh: TerrainMesh,
    photos: Mapping[PhotoKey, Path],
    options: RenderOptions,
    threads: int,
    scale: float = 1.0,
    read: Reader = png.read_photo,
) -> tuple[FitSamples, list[PositionCamera]] | None:
    """Return the samples of all views with a proven pose, and the views; None without samples.

    `FitSamples.lamp` are indices into `lamp_names` of the site.
    `photos`: photos of the run; those of other terrains are ignored. `scale`: scale of the photos from which the
    samples are selected. `read`: see `single_lamps`.
    """
    rigs = read_all_localised(cameras)
    suns = read_suns(cameras, rigs, site, terrain)
    surfaces = build_surfaces(mesh, options)
    paths: dict[PositionCamera, dict[PhotoKey, Path]] = {}
    for key, path in photos.items():
        if key.terrain == terrain and path.is_file():
            paths.setdefault((key.position, key.camera), {})[key] = path
    views = [view for view in sorted(paths) if view[0] in rigs and not rigs[view[0]].unproven]
    parts: list[FitSamples] = []
    for number, view in enumerate(track(views, f"photos of terrain {terrain_text(terrain)}")):
        rig = rigs[view[0]]
        camera, lamps = rig.camera(view[1]), lamps_of_rig(suns, rig, site)
        small = camera if scale == 1 else camera.scaled(scale)
        images = single_lamps(paths[view], camera.lens, site.suns, read)
        photos_of_lamp = {name: image.resized(small.lens) for name, image in images.items()}
        parts += samples_of_view(surfaces, number, small, lamps, photos_of_lamp, lamp_names(site), threads)
    parts = [part.part(part.face < len(mesh.faces)) for part in parts]  # excludes skirts
    samples = FitSamples.joined(parts) if parts else None
    return (samples, views) if samples is not None and len(samples) else None


def samples_of_scene(terrain: Terrain, samples: FitSamples, names: Sequence[str]) -> FitSamples:
    """Return the samples without those of Sun lamps whose photos differ too much from the scene (`MAX_STOPS`).

    `names`: names of the lamps, indexed by `FitSamples.lamp`. If the median over lamps is too large, no sample is left.
    Not for cover photos, see `MAX_STOPS`.
    """
    with np.errstate(divide="ignore"):
        ratio = np.log(samples.rate / dot(samples.normal, samples.to_lamp))
    found = {
        number: median_stops(ratio[samples.lamp == number], samples.view[samples.lamp == number])
        for number in np.unique(samples.lamp).tolist()
        if names[number] != ROVER
    }
    text = ", ".join(f"{names[number]} {stops:.2f}" for number, stops in found.items())
    if found and np.median(list(found.values())) > MAX_STOPS:
        log.warning("terrain %s: photos of another scene or of other lamps, not fitted: difference from the meshes "
                    "%s stops (azimuth, median), expected at most %g",
                    terrain_text(terrain), text, MAX_STOPS)  # fmt: skip
        return samples.part(np.zeros(0, int))
    refused = [number for number, stops in found.items() if stops > MAX_STOPS]
    if refused:
        of = ", ".join(names[number] for number in refused)
        log.warning("terrain %s: photos of azimuth %s are not fitted: photos differ from the meshes by %s stops "
                    "(azimuth, median), expected at most %g", terrain_text(terrain), of, text, MAX_STOPS)  # fmt: skip
    return samples.part(~np.isin(samples.lamp, refused))


def median_stops(ratio: np.ndarray, view: np.ndarray) -> float:
    """Return the median |log2| of photo over twin around the median of each view; `ratio` (n,): natural logarithm."""
    residual = ratio.astype(float)
    for number in np.unique(view):
        residual[view == number] -= np.median(residual[view == number])
    return float(f"{np.median(np.abs(residual)) / np.log(2):.4g}")


def lamps_in(samples: FitSamples, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the lamps of the samples; `names`: see `samples_of_scene`."""
    return tuple(names[number] for number in np.unique(samples.lamp))

"""Samples of all photos of a terrain, for the fits of light and materials."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.photo import SUNS, PhotoKey, PositionCamera
from polarsim.progress import track
from polarsim.render.fitting.exposures import Reader, single_lamps
from polarsim.render.fitting.samples import FitSamples, samples_of_view
from polarsim.render.lamps import ROVER, lamps_of_rig
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import TerrainMesh

LAMPS = (*SUNS, ROVER)  # names of the lamps, indexed by `FitSamples.lamp`


def samples_of_terrain(
    terrain: int,
    cameras: Path,
    mesh: TerrainMesh,
    photos: Mapping[PhotoKey, Path],
    options: RenderOptions,
    threads: int,
    scale: float = 1.0,
    read: Reader = png.read_photo,
) -> tuple[FitSamples, list[PositionCamera]] | None:
    """Return the samples of all views with a proven pose, and the views; None without samples.

    `photos`: photos of the run; those of other terrains are ignored. `scale`: scale of the photos from which the
    samples are selected. `read`: see `single_lamps`.
    """
    rigs = read_all_localised(cameras)
    suns = read_suns(cameras, rigs)
    surfaces = build_surfaces(mesh, options)
    paths: dict[PositionCamera, dict[PhotoKey, Path]] = {}
    for key, path in photos.items():
        if key.terrain == terrain and path.is_file():
            paths.setdefault((key.position, key.camera), {})[key] = path
    views = [view for view in sorted(paths) if view[0] in rigs and not rigs[view[0]].unproven]
    parts: list[FitSamples] = []
    for number, view in enumerate(track(views, f"photos of terrain {terrain:02d}")):
        rig = rigs[view[0]]
        camera, lamps = rig.camera(view[1]), lamps_of_rig(suns, rig)
        small = camera if scale == 1 else camera.scaled(scale)
        images = single_lamps(paths[view], camera.lens, read)
        photos_of_lamp = {name: image.resized(small.lens) for name, image in images.items()}
        parts += samples_of_view(surfaces, number, small, lamps, photos_of_lamp, LAMPS, threads)
    parts = [part.part(part.face < len(mesh.faces)) for part in parts]  # excludes skirts
    samples = FitSamples.joined(parts) if parts else None
    return (samples, views) if samples is not None and len(samples) else None


def lamps_in(samples: FitSamples) -> tuple[str, ...]:
    """Return the names of the lamps of the samples."""
    return tuple(LAMPS[number] for number in np.unique(samples.lamp))

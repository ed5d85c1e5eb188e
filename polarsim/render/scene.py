"""One picture of one terrain: any camera pose, lens, lamps, exposure and model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.formats.scene import read_terrain
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.randomness import generator
from polarsim.render.gain import default_gain
from polarsim.render.lamps import Lamp
from polarsim.render.layers import render_view
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, vignette
from polarsim.render.surfaces import surfaces_of


def render_scene(
    *,
    meshes: Path,
    terrain: int,
    sandbox_from_camera: Pose,
    lens: Lens,
    lamps: Mapping[str, Lamp],
    exposure_ms: float,
    model: Model,
    options: RenderOptions,
    threads: int = 1,
) -> np.ndarray:
    """Render one picture.

    Parameters
    ----------
    meshes : Path
        Folder with `terrainNN_ground.obj` and `terrainNN_rock<k>.obj`.
    sandbox_from_camera : Pose
        `geometry.poses.looking` makes one from a place and angles.
    lens : Lens
        `lens.scaled(0.25)` renders a small picture.
    lamps : name -> Lamp
        Near points or discs of light, or `Lamp.sun`; any names. None: black.
    exposure_ms : float
        Exposure time, ms.
    model : str
        One of `render.options.MODELS`; its parameters and gain are those of the options.

    Returns
    -------
    (h, w) uint16
        12-bit grey values, black level 16.

    Raises
    ------
    FormatError
        Meshes are missing or broken.
    RenderError
        The engine cannot be loaded.
    """
    surfaces = surfaces_of(read_terrain(meshes, terrain), options)
    view = render_view(surfaces, sandbox_from_camera, lens, lamps, [model], None, options, threads)
    radiance = sum(view.layers.values(), np.zeros((lens.height, lens.width), np.float32))
    if options.vignetting:
        radiance = radiance * vignette(lens)
    gain = options.gain.get(model, default_gain(model, options))
    noise = generator(options.seed, "sensor", "scene", terrain, exposure_ms) if options.noise else None
    return expose(radiance, exposure_ms * gain, noise)

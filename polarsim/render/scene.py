"""Pictures and maps of one terrain: any camera pose, lens, lamps, exposure and model."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import polarsim
from polarsim.formats import obj
from polarsim.formats.rigs import lens_content
from polarsim.formats.scene import read_terrain
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL
from polarsim.render.gain import default_gain
from polarsim.render.lamps import Lamp
from polarsim.render.layers import render_view
from polarsim.render.maps import Maps, maps_of
from polarsim.render.optics import through_lens
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, noise_of
from polarsim.render.surfaces import Surfaces, surfaces_of


@dataclass(frozen=True)
class Shot:
    """What makes a picture of a scene.

    Parameters
    ----------
    sandbox_from_camera : Pose
        `geometry.poses.looking` makes one from a place and angles.
    lens : Lens
        `lens.scaled(0.25)` renders a small picture.
    lamps : name -> Lamp
        Near points or discs of light, or `Lamp.sun`; any names. None: black.
    exposure_ms : float
        Exposure time, ms.
    model : str
        One of `render.options.MODELS`; its parameters and gain are those of the scene's options.
    """

    sandbox_from_camera: Pose
    lens: Lens
    lamps: Mapping[str, Lamp]
    exposure_ms: float
    model: Model


class Scene:
    """A terrain's meshes under given options; read once for all pictures."""

    def __init__(self, meshes: Path, terrain: int, options: RenderOptions) -> None:
        """
        Parameters
        ----------
        meshes : Path
            Folder with `terrainNN_ground.obj` and `terrainNN_rock<k>.obj`.

        Raises
        ------
        FormatError
            Meshes are missing or broken.
        """
        self.meshes, self.terrain, self.options = meshes, terrain, options
        self._mesh = read_terrain(meshes, terrain)

    @cached_property
    def surfaces(self) -> Surfaces:
        return surfaces_of(self._mesh, self.options)

    @cached_property
    def mesh_digests(self) -> dict[str, str]:
        """SHA-256 of every mesh by its file's name."""
        paths = [self.meshes / obj.ground_name(self.terrain), *obj.rock_files(self.meshes).values()]
        return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}

    def picture(self, shot: Shot, threads: int = 1) -> np.ndarray:
        """(h, w) uint16 photo: 12-bit grey values, black level 16.

        Raises
        ------
        RenderError
            The engine cannot be loaded.
        """
        pose, lens, lamps, options = shot.sandbox_from_camera, shot.lens, shot.lamps, self.options
        view = render_view(self.surfaces, pose, lens, lamps, [shot.model], None, options, threads)
        layers = through_lens(view.whole, lamps, self.surfaces, pose, lens, options, threads)
        radiance = sum(layers.values(), np.zeros((lens.height, lens.width), np.float32))
        noise = noise_of(options, "scene", self.terrain, shot.exposure_ms)
        return expose(radiance, shot.exposure_ms * self.gain(shot.model), options, noise)

    def maps(self, shot: Shot, threads: int = 1) -> Maps:
        """Depth, normals and ids of what a shot shows, and its angles to the first of its lamps."""
        lamp = next(iter(shot.lamps.values()), None)
        return maps_of(self.surfaces, shot.sandbox_from_camera, shot.lens, lamp, threads)

    def gain(self, model: Model) -> float:
        """Grey values per ms and unit radiance."""
        return self.options.gain.get(model, default_gain(model, self.options))

    def sidecar(self, shot: Shot) -> dict[str, Any]:
        """All that made a picture, for JSON: lens, pose, lamps, exposure, model, meshes and their SHA-256."""
        return {
            "lens": lens_content(shot.lens),
            "sandbox_from_camera": shot.sandbox_from_camera.matrix.tolist(),
            "lamps": {
                name: asdict(lamp) | {"position": np.asarray(lamp.position, float).tolist()}
                for name, lamp in shot.lamps.items()
            },
            "exposure_ms": shot.exposure_ms,
            "model": shot.model,
            "parameters": self.options.parameters(shot.model).model_dump(),
            "gain_per_ms": self.gain(shot.model),
            "black_level": BLACK_LEVEL,
            "options": self.options.model_dump(mode="json"),
            "terrain": self.terrain,
            "meshes": self.mesh_digests,
            "polarsim": polarsim.__version__,
        }

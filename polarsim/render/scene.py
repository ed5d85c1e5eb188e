"""Images and maps of one terrain for any camera pose, lens, lamps, exposure and reflectance model."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.photo import Terrain
from polarsim.render.gain import gain_of
from polarsim.render.maps import Maps, compute_maps
from polarsim.render.olat import render_view
from polarsim.render.optics import apply_lens_to_olat_images
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, noise_generator, noise_seed
from polarsim.render.sidecar import Shot, Sidecar, digests_of
from polarsim.render.surfaces import Surfaces, build_surfaces, check_position
from polarsim.run_files.scene import cameras_of_run, mesh_files, read_terrain
from polarsim.run_files.walls import walls_file
from polarsim.site import Site, polar
from polarsim.site_parts import Sandbox


class Scene:
    """Meshes of a terrain and render options; the meshes are read once for all images."""

    def __init__(self, meshes: Path, terrain: Terrain, options: RenderOptions, site: Site | None = None) -> None:
        """`meshes`: folder with `terrainNN_ground.obj` and `terrainNN_rock<k>.obj`.

        The walls are those of twins: fitted to photos, if the folder is part of a run that has fitted them. A terrain
        that the site (None: NASA's POLAR) does not have has no walls, unless the folder has a file of walls.
        """
        self.meshes, self.terrain, self.options, self.site = meshes, terrain, options, site or polar()
        self._cameras = cameras_of_run(meshes)
        sandbox = Sandbox(half_width_m=self.site.sandbox.half_width_m)  # of a terrain that the site does not have
        if terrain in self.site.terrains:
            sandbox = self.site.sandbox_of(terrain)
        self._mesh = read_terrain(meshes, terrain, sandbox, cameras=self._cameras)

    @cached_property
    def surfaces(self) -> Surfaces:
        return build_surfaces(self._mesh, self.options)

    @cached_property
    def digests(self) -> dict[str, str]:
        """SHA-256 of every mesh and of the file of the walls by file name."""
        walls = walls_file(self.meshes, self._cameras)
        return digests_of([*mesh_files(self.meshes, self.terrain).values(), *([walls] if walls else [])])

    def refuse_positions(self, shot: Shot) -> None:
        """Raise `RenderError` if the camera or a lamp is below the ground or more than a kilometre away."""
        check_position(self.surfaces, shot.camera.centre, "the camera")
        for lamp in shot.lamps.values():
            if not lamp.distant:
                check_position(self.surfaces, lamp.position, "the lamp")

    def picture(self, shot: Shot, threads: int = 1) -> np.ndarray:
        """Render a photo (h, w) uint16: 12-bit DN, black level 16."""
        camera, lamps, options = shot.camera, shot.lamps, self.options
        view = render_view(self.surfaces, camera, lamps, [shot.model], None, options, threads)
        olat_images = apply_lens_to_olat_images(view.whole, lamps, self.surfaces, camera, options, threads)
        radiance = sum(olat_images.values(), np.zeros(camera.lens.shape, np.float32))
        noise = noise_generator(options, "scene", self.terrain, shot.exposure_ms)
        return expose(radiance, shot.exposure_ms * self.gain(shot.model), options, noise)

    def maps(self, shot: Shot, threads: int = 1) -> Maps:
        """Compute depth, normals and ids of a shot, and the angles and shadows of each lamp."""
        return compute_maps(self.surfaces, shot.camera, shot.lamps, self.options, threads)

    def gain(self, model: Model) -> float:
        """Return the gain, DN per ms per unit radiance."""
        return gain_of(model, self.options, self.site)

    def sidecar(self, shot: Shot) -> dict[str, Any]:
        """Return the content of the JSON file of an image: see `render.sidecar`."""
        seed = noise_seed(self.options, "scene", self.terrain, shot.exposure_ms)
        return Sidecar(shot, self.terrain, self.options, self.gain(shot.model), self.digests, seed).content()

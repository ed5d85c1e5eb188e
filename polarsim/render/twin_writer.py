"""Writer of twins: images by model, exposed from the OLAT images of a view, with sidecar files."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.geometry.camera import Camera
from polarsim.photo import PhotoKey, Terrain, by_bracket, terrain_text
from polarsim.photo_format import as_stored
from polarsim.render.gain import calibrate, default_gain, with_fitted_intensities
from polarsim.render.indirect import OlatImages
from polarsim.render.lamps import Lamp, lamps_on
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, noise_generator, noise_seed
from polarsim.render.sidecar import Shot, Sidecar, digest_of, write_sidecar
from polarsim.run_files import lamps as lamp_files
from polarsim.run_files.materials import FittedMaterials
from polarsim.run_files.scene import mesh_files
from polarsim.run_files.walls import walls_file
from polarsim.site import Site

log = logging.getLogger("polarsim.render")


def input_digests(terrain: Terrain, meshes: Path, cameras: Path, lamps: Path) -> dict[str, str]:
    """Return the digests of the inputs common to all twins of a terrain, for `sources` of the sidecars.

    `cameras`, `meshes`: folders that may contain `walls.json`, see `walls_file`.
    `lamps`: folder of `lamps.json`, which exists if the lamps were localised on photos.
    """
    lamp_file = lamps / lamp_files.FILE
    walls = walls_file(meshes, cameras)
    return {
        "meshes": digest_of(mesh_files(meshes, terrain).values()),
        **({"walls": digest_of([walls])} if walls else {}),
        **({"lamps": digest_of([lamp_file])} if lamp_file.exists() else {}),
    }


@dataclass
class TwinWriter:
    """Writer of the twins of a terrain, view by view.

    In addition to `sources`, sidecars record `camera` (`PosX.json` of the position) and `photos` (the photos on which
    the gain of the model was calibrated, if any). The view of the photos `references` must be written first.
    """

    site: Site
    terrain: Terrain
    twins: Mapping[Model, Path]
    cameras: Path
    sources: Mapping[str, str]
    references: Mapping[PhotoKey, Path]  # photos for the calibration of models without a gain
    fitted: FittedMaterials | None
    options: RenderOptions
    _gains: dict[Model, tuple[float, dict[str, str]]] = field(default_factory=dict)  # and digest of the photos

    def __post_init__(self) -> None:
        for folder in self.twins.values():
            folder.mkdir(parents=True, exist_ok=True)

    def write(
        self,
        keys: Sequence[PhotoKey],
        olat_images: OlatImages,
        lamps: Mapping[str, Lamp],
        camera: Camera,
        pool: Executor,
    ) -> None:
        """Write `KEY.png` and `KEY.json` of one view for every model, with one task per exposure bracket."""
        brackets, tasks = list(by_bracket(keys).values()), []
        of_camera = {"camera": digest_of([self.cameras / f"Pos{keys[0].position}.json"])} if keys else {}
        for model in self.twins:
            gain, photos = self._gain(model, olat_images)
            sources = {**self.sources, **photos, **of_camera}
            active_lamps = with_fitted_intensities(lamps, self.fitted, model)
            of_model = {name: olat_image for (other, name), olat_image in olat_images.items() if other == model}
            if active_lamps is not lamps:
                of_model = {
                    name: olat_image * (active_lamps[name].intensity / lamps[name].intensity)
                    for name, olat_image in of_model.items()
                }
            for bracket in brackets:
                arguments = (bracket, model, of_model, active_lamps, camera, gain, sources)
                tasks.append(pool.submit(self._write_bracket, *arguments))
        for task in tasks:
            task.result()

    def _write_bracket(
        self,
        bracket: Sequence[PhotoKey],
        model: Model,
        olat_images: Mapping[str, np.ndarray],
        lamps: Mapping[str, Lamp],
        camera: Camera,
        gain: float,
        sources: Mapping[str, str],
    ) -> None:
        folder, options = self.twins[model], self.options
        radiance = sum((olat_images[name] for name in lamps_on(bracket[0])), np.zeros(camera.lens.shape, np.float32))
        active_lamps = {name: lamps[name] for name in lamps_on(bracket[0])}
        for key in bracket:
            photo = expose(radiance, key.exposure_ms * gain, options, noise_generator(options, key))
            png.write_png(folder / f"{key}.png", as_stored(photo, self.site.images))
            shot = Shot(camera, active_lamps, float(key.exposure_ms), model)
            sidecar = Sidecar(shot, self.terrain, options, gain, sources, noise_seed(options, key))
            write_sidecar(folder / f"{key}.json", sidecar.content())

    def _gain(self, model: Model, olat_images: OlatImages) -> tuple[float, dict[str, str]]:
        """Return the gain (options, else photos, else default) and the digest of the calibration photos."""
        if model not in self._gains and self.options.gain.get(model):
            self._gains[model] = self.options.gain[model], {}
        if model not in self._gains:
            calibrated = calibrate(self.references, olat_images, model)
            gain = calibrated or default_gain(model, self.options, self.site)
            origin = "from photos" if calibrated else "default"
            log.info("terrain %s, %s: gain %.6g (%s)", terrain_text(self.terrain), model, gain, origin)
            self._gains[model] = gain, {"photos": digest_of(self.references.values())} if calibrated else {}
        return self._gains[model]

"""The files of a terrain's twins: pictures by model, exposed from a view's OLAT images, and what made them beside
each.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.photo import PhotoKey, by_bracket
from polarsim.render.gain import as_bright_as_fitted, calibrate, default_gain
from polarsim.render.indirect import OlatImages
from polarsim.render.lamps import Lamp, lit_by
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, noise_of, noise_seed
from polarsim.render.sidecar import Shot, Sidecar, digest_of, write_sidecar
from polarsim.run_files import lamps as lamp_files
from polarsim.run_files import materials as material_files
from polarsim.run_files.materials import FittedMaterials
from polarsim.run_files.scene import mesh_files

log = logging.getLogger("polarsim.render")


def sources_of(terrain: int, meshes: Path, lamps: Path, materials: Path | None) -> dict[str, str]:
    """What all of a terrain's twins come from, hashed once for the `sources` of their sidecars; given are its folders.

    `lamps`: `lamps.json`, where photos showed where lamps stood; `materials`: what was fitted to photos, if it was:
    albedo by vertex is in there alone, and lamps are as bright as it says.
    """
    found = lamps / lamp_files.FILE
    return {
        "meshes": digest_of(mesh_files(meshes, terrain).values()),
        **({"lamps": digest_of([found])} if found.exists() else {}),
        **({"materials": digest_of(material_files.files_of(materials))} if materials else {}),
    }


@dataclass
class TwinWriter:
    """Writes the twins of one terrain, view by view.

    Beside the `sources`, sidecars name `camera`, the position's `PosX.json`, and `photos`, those that set the model's
    gain, where there were some.

    Parameters
    ----------
    twins : model -> Path
        Folders, made if they are not there.
    cameras : Path
        Folder with the terrain's `PosX.json`.
    references : key -> Path
        Photos that set the brightness of models without a gain; their view must be written first.
    """

    terrain: int
    twins: Mapping[Model, Path]
    cameras: Path
    sources: Mapping[str, str]
    references: Mapping[PhotoKey, Path]
    fitted: FittedMaterials | None
    options: RenderOptions
    _gains: dict[Model, tuple[float, dict[str, str]]] = field(default_factory=dict)  # and the photos behind them

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
        """Write `KEY.png` and `KEY.json` of one view into the folder of every model, an exposure bracket a task."""
        brackets, tasks = list(by_bracket(keys).values()), []
        of_camera = {"camera": digest_of([self.cameras / f"Pos{keys[0].position}.json"])} if keys else {}
        for model in self.twins:
            gain, photos = self._gain(model, olat_images)
            sources = {**self.sources, **photos, **of_camera}
            active_lamps = as_bright_as_fitted(lamps, self.fitted, model)
            own = {name: olat_image for (of, name), olat_image in olat_images.items() if of == model}
            if active_lamps is not lamps:
                own = {
                    name: olat_image * (active_lamps[name].intensity / lamps[name].intensity)
                    for name, olat_image in own.items()
                }
            for bracket in brackets:
                tasks.append(pool.submit(self._write_bracket, bracket, model, own, active_lamps, camera, gain, sources))
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
        folder = self.twins[model]
        write_photos(folder, bracket, olat_images, camera.lens, gain, self.options)
        for key in bracket:
            shot = Shot(camera, {name: lamps[name] for name in lit_by(key)}, float(key.exposure_ms), model)
            sidecar = Sidecar(shot, self.terrain, self.options, gain, sources, noise_seed(self.options, key))
            write_sidecar(folder / f"{key}.json", sidecar.content())

    def _gain(self, model: Model, olat_images: OlatImages) -> tuple[float, dict[str, str]]:
        """Of the options, else as bright as the photos, else built in; of photos also their digest."""
        if model not in self._gains and self.options.gain.get(model):
            self._gains[model] = self.options.gain[model], {}
        if model not in self._gains:
            found = calibrate(self.references, olat_images, model)
            gain, origin = found or default_gain(model, self.options), "from photos" if found else "built in"
            log.info("terrain %02d, %s: gain %.6g, %s", self.terrain, model, gain, origin)
            self._gains[model] = gain, {"photos": digest_of(self.references.values())} if found else {}
        return self._gains[model]


def write_photos(
    folder: Path,
    bracket: Sequence[PhotoKey],
    olat_images: Mapping[str, np.ndarray],
    lens: Lens,
    gain: float,
    options: RenderOptions,
) -> None:
    """Write the photos of an exposure bracket, `folder/KEY.png`, from its view's OLAT images by lamp."""
    dark = np.zeros(lens.shape, np.float32)
    radiance = sum((olat_images[name] for name in lit_by(bracket[0])), dark)
    for key in bracket:
        noise = noise_of(options, key)
        png.write(folder / f"{key}.png", expose(radiance, key.exposure_ms * gain, options, noise))

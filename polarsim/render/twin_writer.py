"""The files of a terrain's twins: pictures by model, exposed from a view's OLAT images, and what made them beside
each.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from polarsim.formats import lamps as lamp_files
from polarsim.formats import materials as material_files
from polarsim.formats import png
from polarsim.formats.materials import FittedMaterials
from polarsim.formats.scene import mesh_files
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.photo import PhotoKey, by_bracket
from polarsim.render.gain import as_bright_as_fitted, calibrate, default_gain
from polarsim.render.indirect import OlatImages
from polarsim.render.lamps import Lamp, lit_by
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, noise_of, noise_seed
from polarsim.render.sidecar import Shot, Sidecar, digest_of, write_sidecar

log = logging.getLogger("polarsim.render")


class TwinSidecars:
    """Sidecars of one terrain's twins.

    Their `sources` are `meshes`; `camera`: the position's `PosX.json`; `lamps`: `lamps.json`, where photos showed where
    lamps stood; `photos`: those that set the model's gain, where there were some; `materials`: what was fitted to
    photos, if it was: albedo by vertex is in there alone, and lamps are as bright as it says.
    """

    def __init__(
        self, terrain: int, meshes: Path, cameras: Path, lamps: Path, materials: Path | None, options: RenderOptions
    ) -> None:
        """`meshes`, `cameras`, `lamps`, `materials`: the terrain's folders."""
        self.terrain, self._cameras, self._options = terrain, cameras, options
        found = lamps / lamp_files.FILE
        self._sources = {
            "meshes": digest_of(mesh_files(meshes, terrain).values()),
            **({"lamps": digest_of([found])} if found.exists() else {}),
            **({"materials": digest_of(material_files.files_of(materials))} if materials else {}),
        }
        self._photos: dict[Model, str] = {}

    def set_gain_by(self, model: Model, photos: Iterable[Path]) -> None:
        """Say which photos a model's gain rests on."""
        self._photos[model] = digest_of(photos)

    def write(self, folder: Path, keys: Iterable[PhotoKey], view: Shot, gain: float) -> None:
        """Write `folder/KEY.json` for the keys of one view; `view` has all of its lamps."""
        sources = dict(self._sources)
        if view.model in self._photos:
            sources["photos"] = self._photos[view.model]
        camera: Mapping[str, str] = {}
        for key in keys:
            camera = camera or {"camera": digest_of([self._cameras / f"Pos{key.position}.json"])}
            shot = replace(
                view, lamps={name: view.lamps[name] for name in lit_by(key)}, exposure_ms=float(key.exposure_ms)
            )
            seed = noise_seed(self._options, key)
            told = Sidecar(shot, self.terrain, self._options, gain, {**sources, **camera}, seed)
            write_sidecar(folder / f"{key}.json", told.content())


class TwinWriter:
    """Writes the twins of one terrain, view by view."""

    def __init__(
        self,
        twins: Mapping[Model, Path],
        references: Mapping[PhotoKey, Path],
        fitted: FittedMaterials | None,
        sidecars: TwinSidecars,
        options: RenderOptions,
        threads: int,
    ) -> None:
        """
        Parameters
        ----------
        twins : model -> Path
            Folders, made if they are not there.
        references : key -> Path
            Photos that set the brightness of models without a gain; their view must be written first.
        """
        for folder in twins.values():
            folder.mkdir(parents=True, exist_ok=True)
        self._twins, self._references, self._fitted, self._sidecars = twins, references, fitted, sidecars
        self._options, self._threads = options, threads
        self._gains = {model: options.gain[model] for model in twins if options.gain.get(model)}

    def write(
        self, keys: Sequence[PhotoKey], olat_images: OlatImages, lamps: Mapping[str, Lamp], camera: Camera
    ) -> None:
        """Write `KEY.png` and `KEY.json` of one view into the folder of every model."""
        for model, folder in self._twins.items():
            gain = self._gain(model, olat_images)
            active_lamps = as_bright_as_fitted(lamps, self._fitted, model)
            own = {name: olat_image for (of, name), olat_image in olat_images.items() if of == model}
            if active_lamps is not lamps:
                own = {
                    name: olat_image * (active_lamps[name].intensity / lamps[name].intensity)
                    for name, olat_image in own.items()
                }
            write_photos(folder, keys, own, camera.lens, gain, self._options, self._threads)
            self._sidecars.write(folder, keys, Shot(camera, active_lamps, 0, model), gain)

    def _gain(self, model: Model, olat_images: OlatImages) -> float:
        """Of the options, else as bright as the photos, else built in."""
        if model not in self._gains:
            found = calibrate(self._references, olat_images, model)
            if found:
                self._sidecars.set_gain_by(model, self._references.values())
            self._gains[model] = found or default_gain(model, self._options)
            origin = "from photos" if found else "built in"
            log.info("terrain %02d, %s: gain %.6g, %s", self._sidecars.terrain, model, self._gains[model], origin)
        return self._gains[model]


def write_photos(
    folder: Path,
    keys: Sequence[PhotoKey],
    olat_images: Mapping[str, np.ndarray],
    lens: Lens,
    gain: float,
    options: RenderOptions,
    threads: int,
) -> None:
    """Write the photos of one view, `folder/KEY.png`, from its OLAT images by lamp."""
    dark = np.zeros(lens.shape, np.float32)

    def write(bracket: list[PhotoKey]) -> None:
        radiance = sum((olat_images[name] for name in lit_by(bracket[0])), dark)
        for key in bracket:
            noise = noise_of(options, key)
            png.write(folder / f"{key}.png", expose(radiance, key.exposure_ms * gain, options, noise))

    with ThreadPoolExecutor(max(1, threads)) as pool:
        list(pool.map(write, by_bracket(keys).values()))

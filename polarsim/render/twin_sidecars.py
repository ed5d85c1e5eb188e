"""The JSON files beside a terrain's twins: what all of them share is read and hashed once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from polarsim.formats import lamps as lamp_files
from polarsim.formats import materials as material_files
from polarsim.formats.scene import mesh_files
from polarsim.photo import PhotoKey
from polarsim.render.lamps import lit_by
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import noise_seed
from polarsim.render.shot import Shot
from polarsim.render.sidecar import Sidecar, digest_of, write_sidecar


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

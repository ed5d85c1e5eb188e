"""The files of one picture among novel views: where they lie, whether they are there, how they are written."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.digest import code_digest
from polarsim.errors import PolarsimError
from polarsim.formats import coco, png, yolo
from polarsim.formats.files import read_json, write_json
from polarsim.photo import BOX_CLASSES
from polarsim.render.views.options import Views
from polarsim.render.views.plan import AUTO, Picture
from polarsim.render.views.sheet import Sheet, Tone

_OF_ONE_TERRAIN = ("terrain", "sources", "noise_seed")  # of a scene's sidecar: views may have several


@dataclass(frozen=True)
class Job:
    """A file of views, and how and where its pictures are written."""

    views: Views
    out: Path
    preview: bool  # eight bits instead of twelve
    tone: Tone
    sheet: Sheet
    digests: dict[str, str] = field(default_factory=dict)  # SHA-256 of instance maps by their names
    code: str = field(default_factory=lambda: code_digest("polarsim.render.views.run"))  # that makes the pictures

    def path(self, kind: str, name: str) -> Path:
        """Of a picture's file in one of the folders."""
        suffix = {"labels": ".txt", "sidecars": ".json"}.get(kind, ".png")
        return self.out / kind / f"{name}{suffix}"

    def sidecar(self, picture: Picture, exposure_ms: float) -> dict[str, Any]:
        """All that makes a picture, as JSON has it; OSError where its instance map is not there."""
        shot, views = picture.shot(self.views, exposure_ms), self.views
        content = picture.scene.parts[0].scene.sidecar(shot)
        own = {
            **{key: value for key, value in content.items() if key not in _OF_ONE_TERRAIN},
            **picture.columns(),
            "terrains": [
                {
                    "terrain": part.section.terrain,
                    "offset_m": list(part.section.offset_m),
                    "heading_deg": part.section.heading_deg,
                    "meshes": part.scene.mesh_digests,
                }
                for part in picture.scene.parts
            ],
            "moment_utc": picture.light.moment_utc,
            "exposure": "stated" if picture.exposure_ms else {AUTO: views.auto_exposure.model_dump()},
            "stars": views.stars.model_dump() if views.stars else None,
            "bits": 8 if self.preview else 12,
            "code": self.code,
            "instances": self._instances_digest(picture.ground_truth),
        }
        return dict(json.loads(json.dumps(own)))

    def found(self, picture: Picture) -> float | None:
        """The exposure of a picture that is there as it would be made now; None where one of its files is not."""
        try:
            there = read_json(self.path("sidecars", picture.name))
            exposure = float(there["exposure_ms"])
            wanted = self.sidecar(picture, picture.exposure_ms or exposure)
        except (PolarsimError, OSError, KeyError, TypeError, ValueError):
            return None
        complete = all(self.path(kind, picture.name).is_file() for kind in ("images", "labels"))
        return exposure if complete and there == wanted else None

    def write_instances(self, picture: Picture, ids: np.ndarray) -> None:
        """Write the instance map (h, w) uint16 that the picture shares with others."""
        self.digests.pop(picture.ground_truth, None)
        png.write(self.path("instances", picture.ground_truth), ids)

    def write(self, picture: Picture, grey: np.ndarray, exposure_ms: float, labels: Sequence[coco.Annotation]) -> None:
        """Write a picture (h, w) uint16 and its boxes, and then its sidecar: where that is, the others are."""
        self.path("sidecars", picture.name).unlink(missing_ok=True)
        pixels = self.tone(grey)[..., 0] if self.preview else grey
        png.write(self.path("images", picture.name), pixels)
        yolo.write_boxes(
            self.path("labels", picture.name),
            np.array([BOX_CLASSES.index(label.kind) for label in labels], int),
            np.array([label.box for label in labels], float),
            picture.size,
        )
        write_json(self.path("sidecars", picture.name), self.sidecar(picture, exposure_ms))
        if self.sheet.wants(picture.name):
            self.sheet.add(picture.name, pixels, labels)

    def _instances_digest(self, name: str) -> str:
        if name not in self.digests:
            self.digests[name] = hashlib.sha256(self.path("instances", name).read_bytes()).hexdigest()
        return self.digests[name]

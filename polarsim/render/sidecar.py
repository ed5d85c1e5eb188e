"""Sidecar: JSON file of an image with everything needed to render the image again and to project points into it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import polarsim
from polarsim.errors import FormatError, with_path
from polarsim.formats.files import read_json, write_text
from polarsim.geometry.camera import Camera
from polarsim.geometry.light_field import POWERS, REACH_M
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL, Terrain
from polarsim.render.lamps import Lamp
from polarsim.render.options import Model, RenderOptions
from polarsim.run_files.rigs import lens_content, lens_of


@dataclass(frozen=True)
class Shot:
    """Camera, lamps, exposure and reflectance model of an image.

    `geometry.poses.camera_pose` returns a pose from a position and angles; `camera.scaled(0.25)` renders a smaller
    image. Lamps are near (points or discs) or `Lamp.sun`, with any names; without lamps the image is black.
    Parameters and gain of the model are in the options of the scene.
    """

    camera: Camera
    lamps: Mapping[str, Lamp]
    exposure_ms: float
    model: Model


# Options that a sidecar contains as `parameters`, `gain_per_ms` and `sources`.
_SEPARATE = {"models", "gain", "maps", "fitting", "materials_from_photos"}


@dataclass(frozen=True)
class Sidecar:
    """Inputs of an image of a terrain; `shot`, `options` and the meshes reproduce the image."""

    shot: Shot
    terrain: Terrain
    options: RenderOptions
    gain_per_ms: float  # DN per ms per unit radiance
    sources: Mapping[
        str, str
    ]  # SHA-256 of input files by name; for twins by role: meshes, walls, camera, lamps, photos
    noise_seed: tuple[Any, ...] = ()  # arguments of `randomness.generator`; empty without noise

    def content(self) -> dict[str, Any]:
        """Return the content of the JSON file."""
        shot = self.shot
        return {
            "terrain": self.terrain,
            "lens": lens_content(shot.camera.lens),
            "sandbox_from_camera": shot.camera.world_from_camera.matrix.tolist(),
            "lamps": {name: _lamp_content(lamp) for name, lamp in shot.lamps.items()},
            "exposure_ms": shot.exposure_ms,
            "model": shot.model,
            "parameters": self.options.parameters(shot.model).model_dump(),
            "gain_per_ms": self.gain_per_ms,
            "black_level": BLACK_LEVEL,
            "noise_seed": [str(part) for part in self.noise_seed],
            "options": self.options.model_dump(mode="json", exclude=_SEPARATE),
            "sources": dict(self.sources),
            "polarsim": polarsim.__version__,
        }


def _lamp_content(lamp: Lamp) -> dict[str, Any]:
    content = asdict(lamp) | {"position": np.asarray(lamp.position, float).tolist()}
    if not lamp.light_field:
        del content["light_field"]
    if not lamp.light_field or lamp.field_reach_m == REACH_M:
        del content["field_reach_m"]
    return content


def _lamp_of(content: Mapping[str, Any]) -> Lamp:
    field = tuple(float(value) for value in content.get("light_field", ()))
    if field and len(field) != len(POWERS):
        raise ValueError(f"light_field has {len(field)} coefficients, expected {len(POWERS)}")
    return Lamp(**{**content, "position": np.array(content["position"], float).reshape(3), "light_field": field})


def write_sidecar(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write `Sidecar.content`, one key per line, in the given order: the first lamp casts the labelled shadows."""
    lines = (f"{json.dumps(name)}: {json.dumps(value, allow_nan=False)}" for name, value in content.items())
    write_text(path, "{" + ",\n ".join(lines) + "}\n")


def read_sidecar(path: str | Path) -> Sidecar:
    """Read the sidecar of an image."""
    content = read_json(path)
    with with_path(path):
        try:
            model, gain = content["model"], float(content["gain_per_ms"])
            shot = Shot(
                Camera(Pose.from_matrix(np.array(content["sandbox_from_camera"], float)), lens_of(content["lens"])),
                {name: _lamp_of(lamp) for name, lamp in content["lamps"].items()},
                float(content["exposure_ms"]),
                model,
            )
            options = RenderOptions(**content["options"], models=(model,), gain={model: gain})
            options = options.with_default(**{model: content["parameters"]})
            seed = tuple(content["noise_seed"])
            return Sidecar(shot, int(content["terrain"]), options, gain, dict(content["sources"]), seed)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            reason = f"{error!r}".splitlines()[0]
            raise FormatError(f"not the sidecar of an image: {reason}") from error


def digests_of(paths: Iterable[Path]) -> dict[str, str]:
    """Return the SHA-256 of files by file name, sorted by path."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(paths)}


def digest_of(paths: Iterable[Path]) -> str:
    """Return a joint SHA-256 of files: the output of `sha256sum NAMES | sha256sum` with sorted names."""
    lines = (f"{digest}  {name}\n" for name, digest in digests_of(paths).items())
    return hashlib.sha256("".join(lines).encode()).hexdigest()

"""What a file of views says, checked before anything is rendered."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, model_validator

from polarsim.formats.yaml_files import read_model
from polarsim.render.options import RenderOptions
from polarsim.render.views.sections import (
    AutoExposure,
    LunarSuns,
    NearLamps,
    OrbitCameras,
    Part,
    PathCameras,
    PinholeLens,
    PointCameras,
    RandomCameras,
    RigLens,
    RoverLight,
    SceneSection,
    StarField,
    Suns,
)


class Views(Part):
    """A file of views. All lengths in metres, sandbox frame: +X to azimuth 0, +Y to 90, +Z up."""

    scenes: tuple[SceneSection, ...] = Field(min_length=1, description="Scenes; each is seen by all cameras.")
    lens: RigLens | PinholeLens = Field(RigLens(), discriminator="kind", description="Of all cameras.")
    stereo: bool = Field(False, description="Every camera is the left one of a pair, the right one takes pictures too.")
    cameras: tuple[
        Annotated[PointCameras | OrbitCameras | PathCameras | RandomCameras, Field(discriminator="kind")], ...
    ] = Field(min_length=1, description="Where pictures are taken from.")
    lights: tuple[Annotated[NearLamps | Suns | LunarSuns, Field(discriminator="kind")], ...] = Field(
        min_length=1, description="What lights the scene, one lamp a picture."
    )
    rover_light: RoverLight = Field(RoverLight(), description="The light on the rover, besides the lamp.")
    exposures_ms: tuple[PositiveFloat | Literal["auto"], ...] = Field(
        ("auto",), min_length=1, description="Exposure times, ms, or auto."
    )
    auto_exposure: AutoExposure = Field(AutoExposure(), description="How auto exposures are found.")
    combine: Literal["product", "zip"] = Field(
        "product",
        description="product: every camera under every light; zip: the first camera under the first light, and so on. "
        "Either in all states of the rover light, models and exposures.",
    )
    stars: StarField | None = Field(None, description="Background of stars; none: black.")
    render: RenderOptions = Field(
        RenderOptions(), description="As in a run's configuration; all `models` are rendered."
    )

    @model_validator(mode="after")
    def _each_once(self) -> Views:
        for what, values in (
            ("scenes: name", [scene.name for scene in self.scenes]),
            ("exposures_ms:", list(self.exposures_ms)),
            ("rover_light.states:", list(self.rover_light.states)),
            ("render.models:", list(self.render.models)),
        ):
            twice = [value for number, value in enumerate(values) if value in values[:number]]
            if twice:
                raise ValueError(f"{what} {twice[0]!r} comes twice")
        return self


def read_views(path: str | Path) -> Views:
    """Read a file of views.

    Raises
    ------
    ConfigError
        No YAML, unknown or missing keys, impossible values: one line with the file and each key.
    """
    return read_model(path, Views, "the file")


def schema() -> str:
    """JSON schema of files of views; `config/views.schema.json` holds it for editors."""
    return json.dumps(Views.model_json_schema(), indent=1, sort_keys=True) + "\n"

"""Options of the ablation: what of the twin is replaced, one component at a time."""

from __future__ import annotations

import re
from typing import Any, Literal, Self

from pydantic import BaseModel, Field, field_validator, model_validator

TWIN = "twin"  # the twin as the run has it, what every component is held against


class Component(BaseModel, extra="forbid", frozen=True):
    """A component differs from the run's twin in what is given here; `truth` is known of the analog alone."""

    cameras: Literal["run", "located", "truth"] = Field(
        "run",
        description="Poses and lenses come from here; located: they are as scans or labels localise them, "
        "without the photos' refinement.",
    )
    lamps: Literal["run", "survey", "truth"] = Field(
        "run", description="Positions of the Sun lamps come from here; survey: they stand where NASA's survey has them."
    )
    meshes: Literal["run", "thinned", "truth"] = Field(
        "run", description="Surfaces of rocks and ground come from here; thinned: rocks have 5 % of their vertices."
    )
    materials: Literal["run", "constant", "fitted"] = Field(
        "run", description="Reflectance has the options' constants, or is fitted to the terrain's photos."
    )
    labels: Literal["run", "propagated"] = Field(
        "run",
        description="Boxes of the twins come from here; propagated: they are those of the photos, propagated "
        "from what people drew.",
    )
    render: dict[str, Any] = Field({}, description="These keys of `render` have other values.")

    @model_validator(mode="after")
    def _replaces_something(self) -> Self:
        if self == type(self).model_construct():
            raise ValueError("replaces nothing")
        if "models" in self.render or "materials_from_photos" in self.render:
            raise ValueError("render: models and materials_from_photos have keys of their own (gap.model, materials)")
        return self

    @property
    def is_rendered(self) -> bool:
        """Whether it needs pictures of its own; other labels alone do not."""
        return self.model_copy(update={"labels": "run"}) != type(self).model_construct()

    @property
    def needs_truth(self) -> bool:
        return "truth" in (self.cameras, self.lamps, self.meshes)

    def describe(self) -> str:
        """What it replaces, in words for a table."""
        parts = [
            f"{name}: {value}"
            for name in ("cameras", "lamps", "meshes", "materials", "labels")
            if (value := getattr(self, name)) != "run"
        ]
        return ", ".join([*parts, *(f"{name}: {_plain(value)}" for name, value in self.render.items())])


class GapOptions(BaseModel, extra="forbid", frozen=True):
    """An ablation tells which component of the twin causes the gap; it is off unless components are named."""

    model: str = Field("hapke", description="The twins have this reflectance model, one of `render.models`.")
    trained_on: tuple[str, ...] = Field(
        (),
        description="Detectors that were trained on these domains are evaluated; none: one of photos and one "
        "of the model's twins are.",
    )
    components: dict[str, Component] = Field(
        {},
        description="These components are replaced in the twins of the ablation, each under a name of small "
        "letters, digits and -.",
    )

    @field_validator("components")
    @classmethod
    def _possible_names(cls, components: dict[str, Component]) -> dict[str, Component]:
        for name in components:
            if name == TWIN or not re.fullmatch(r"[a-z][a-z0-9-]*", name):
                raise ValueError(f"{name!r}: expected a name of small letters, digits and -, and not {TWIN}")
        return components


def _plain(value: object) -> str:
    """A value as YAML has it."""
    return {True: "on", False: "off"}[value] if isinstance(value, bool) else str(value)

"""Options of the ablation, which replaces one component of the twin at a time."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import BaseModel, Field, field_validator, model_validator

from polarsim.detect.options import FolderName

TWIN = "twin"  # name of the unmodified twin, the reference of every component


class Component(BaseModel, extra="forbid", frozen=True):
    """Replaced parts of the twin; `truth` exists for the analog only."""

    cameras: Literal["run", "located", "truth"] = Field(
        "run", description="Source of poses and lenses; located: from scans or labels, without refinement on photos."
    )
    lamps: Literal["run", "survey", "truth"] = Field(
        "run", description="Source of the positions of Sun lamps; survey: approximate positions of the site."
    )
    meshes: Literal["run", "thinned", "truth"] = Field(
        "run", description="Source of the surfaces of rocks and ground; thinned: rocks with 5 % of their vertices."
    )
    materials: Literal["run", "constant", "fitted"] = Field(
        "run",
        description="Source of reflectance: options of the run; fitted: light, lens and materials fitted to photos.",
    )
    labels: Literal["run", "propagated"] = Field(
        "run", description="Source of the boxes of twins; propagated: the boxes of the photos, propagated from seeds."
    )
    render: dict[str, Any] = Field({}, description="Replaced keys of `render`, with the new values.")

    @model_validator(mode="after")
    def _replaces_something(self) -> Self:
        if self == type(self).model_construct():
            raise ValueError("a component must replace at least one part of the twin")
        if "models" in self.render or "materials_from_photos" in self.render:
            raise ValueError("render: models and materials_from_photos cannot be replaced in the ablation")
        return self

    @property
    def is_rendered(self) -> bool:
        """Return whether the component requires rendering. Replaced labels do not."""
        return self.model_copy(update={"labels": "run"}) != type(self).model_construct()

    @property
    def needs_truth(self) -> bool:
        return "truth" in (self.cameras, self.lamps, self.meshes)

    def describe(self) -> str:
        """Return the replaced parts as text for a table."""
        parts = [
            f"{name}: {value}"
            for name in ("cameras", "lamps", "meshes", "materials", "labels")
            if (value := getattr(self, name)) != "run"
        ]
        return ", ".join([*parts, *(f"{name}: {_plain(value)}" for name, value in self.render.items())])


class GapOptions(BaseModel, extra="forbid", frozen=True):
    """Ablation: contribution of the components of the twin to the gap, for the last of `render.models`."""

    components: dict[FolderName, Component] = Field(
        {},
        description="Replaced components by name (lower-case letters, digits and -). Empty: no ablation.",
    )

    @field_validator("components")
    @classmethod
    def _possible_names(cls, components: dict[str, Component]) -> dict[str, Component]:
        if TWIN in components:
            raise ValueError(f"{TWIN!r} is the name of the unmodified twin, expected another name")
        return components


def _plain(value: object) -> str:
    """Return a value in YAML notation."""
    return {True: "on", False: "off"}[value] if isinstance(value, bool) else str(value)

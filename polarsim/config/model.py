"""Complete and consistent configuration of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError, field_validator, model_validator

from polarsim.config.checks import check_sections
from polarsim.config.digest import config_digest
from polarsim.config.sections import Sections
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import NO_SUN, Terrain
from polarsim.rover.world.options import BORDER_M, EDGE_M
from polarsim.site import DEFAULT, Site, polar, site_of


class Config(Sections):
    """Configuration of one run."""

    @model_validator(mode="before")
    @classmethod
    def _with_site(cls, content: Any) -> Any:
        """Read the site, and select all that it has where the configuration selects nothing."""
        if not isinstance(content, dict):
            return content
        try:
            site = Site.model_validate(site_of(content.get("site", DEFAULT)))
        except ValidationError as error:
            text = describe_error(error, "site")
            raise ValueError(text if text.startswith("site:") else f"site.{text}") from error
        whole = {"positions": site.positions, **content, "site": site}
        if site != polar():
            whole = {"terrains": tuple(site.terrains), **whole}
        chosen = {"lights": site.lights, "azimuths": site.azimuths, "cameras": site.cameras.sides}
        whole["grid"] = _with_defaults(content.get("grid"), chosen)
        labels = content.get("labels", {})
        if isinstance(labels, dict) and isinstance(seeds := labels.get("seeds", {}), dict):
            whole["labels"] = {**labels, "seeds": _with_defaults(seeds, {"azimuths": site.suns})}
        if isinstance(render := content.get("render", {}), dict):
            held_out = site.suns[0] if len(site.suns) > 1 else NO_SUN
            whole["render"] = {**render, "fitting": _with_defaults(render.get("fitting"), {"held_out": held_out})}
        if isinstance(rover := content.get("rover", {}), dict):
            along, across = (2 * half for half in site.sandbox.half_width_m)
            length = max(along - 2 * EDGE_M, along / 2)  # a sandbox below 1 m has narrower edges
            strip = {"terrain_m": length, "width_m": across + 2 * BORDER_M}
            if site != polar():
                strip["terrains"] = whole["terrains"]
            whole["rover"] = {**rover, "world": _with_defaults(rover.get("world"), strip)}
        return whole

    @field_validator("terrains")
    @classmethod
    def _each_once(cls, values: tuple[Terrain, ...]) -> tuple[Terrain, ...]:
        if len(set(values)) < len(values):
            raise ValueError("a terrain is listed twice")
        return values

    @model_validator(mode="after")
    def _consistent(self) -> Config:
        check_sections(self)
        return self

    def digest(self) -> str:
        """Return a digest of all options that can change a result, for tables.

        The digest does not depend on the name of the run, on folders and downloads of data, or on unused sections.
        """
        return config_digest(self)


def _with_defaults(section: Any, values: Mapping[str, Any]) -> Any:
    """Return a section of a configuration with values for keys that it does not set; other content is returned."""
    if section is None:
        return dict(values)
    if not isinstance(section, dict):
        return section
    missing = {name: value for name, value in values.items() if section.get(name) is None}
    return {**section, **missing}

"""Paths of the files of a site, for writing; `site_files` finds them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.site import Site
from polarsim.site_file_names import FIELD


def format_path(site: Site, pattern: str, terrain: Terrain, fields: Mapping[str, Any], anys: Sequence[str] = ()) -> str:
    """Return the path of a file to write: `fields` by name, and a text for each field `any`, in order."""
    texts = iter(anys)

    def text_of(match: re.Match[str]) -> str:
        name, _, width = match[1].partition(":")
        if "|" in match[1]:
            return match[1].split("|")[0]
        if name == "any":
            return next(texts)
        if name == "terrain":
            return spelled_text(site, name, terrain_text(terrain))
        if name == "terrain_name":
            return site.options(terrain).name or "Unnamed"
        if name == "exposure_ms":
            return str(fields[name]).zfill(int(width or 0))
        return spelled_text(site, name, str(fields[name]))

    return FIELD.sub(text_of, pattern)


def photo_fields(key: PhotoKey) -> dict[str, Any]:
    """Return the fields of the path of a photo."""
    return {
        "position": key.position, "light": key.light, "azimuth": key.azimuth, "camera": key.camera,
        "exposure_ms": key.exposure_ms,
    }  # fmt: skip


def spelled_text(site: Site, name: str, value: str) -> str:
    """Return the text of a name in paths."""
    return site.files.spelling.get(name, {}).get(value, value)

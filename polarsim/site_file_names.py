"""Names of the files of a site."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from typing import Literal

from pydantic import Field, field_validator

from polarsim.photo import parse_terrain, terrain_text
from polarsim.site_parts import Part, text_of_name

_NAMED = ("terrain", "terrain_name", "position", "light", "azimuth", "camera", "exposure_ms")  # fields of file names
_SPELLED = ("terrain", "position", "light", "azimuth", "camera")
FIELD = re.compile(r"{([^{}/]*)}")  # of a pattern of file names


def composed(text: str) -> str:
    """Return a text with composed characters (NFC), since a file system may store the accents of names separately."""
    return unicodedata.normalize("NFC", text)


class Files(Part):
    """Names of the files below `source.root`, with fields in braces.

    Fields: {terrain} {terrain_name} {position} {light} {azimuth} {camera} {exposure_ms} {any}. `exposure_ms` matches an
    integer, `exposure_ms:4` one of at least four digits, `any` any text without a slash. Other fields match names
    of the site, or their `spelling`. {png|tif} matches one of several texts. Suffixes match in upper and lower case.
    """

    photos: str = Field(description="Path of a photo: {terrain}/{position}/{azimuth}/{camera}_{exposure_ms}.png.")
    clouds: str | None = Field(None, description="Path of a scan of a position; null: no scans.")
    range_maps: str | None = Field(None, description="Path of a range map on the rectified left image; null: none.")
    calibration: str | None = Field(None, description="Path of a terrain's calibration; null: cameras.calibration.")
    spelling: Mapping[str, Mapping[str, str]] = Field(
        {}, description="Texts of names in paths that differ: azimuth: {'45': sun45, 'no': dark}, camera: {L: left}."
    )
    cloud_frame: Literal["left", "rectified"] = Field(
        "left",
        description="Frame of the clouds: left camera (x right, y down, z forward), or rectified left camera.",
    )
    cloud_unit: Literal["mm", "m"] = Field("m", description="Unit of the clouds.")

    @field_validator("photos", "clouds", "range_maps", "calibration")
    @classmethod
    def _known_fields(cls, pattern: str | None) -> str | None:
        if pattern is None:
            return None
        pattern = composed(pattern)
        for field in FIELD.findall(pattern):
            if "|" not in field and field.partition(":")[0] not in (*_NAMED, "any"):
                raise ValueError(
                    f"{{{field}}} is no field, expected {', '.join(f'{{{name}}}' for name in _NAMED)}, {{any}}"
                )
            if ":" in field and not re.fullmatch(r"exposure_ms:\d", field):
                raise ValueError(f"{{{field}}}: only exposure_ms may have a number of digits, {{exposure_ms:4}}")
        if re.search("[{}]", FIELD.sub("", pattern)):
            raise ValueError("a brace is not closed")
        if pattern.startswith("/") or ".." in pattern.split("/") or "\\" in pattern:
            raise ValueError("expected a path below source.root, with slashes between folders")
        return pattern

    @field_validator("spelling", mode="before")
    @classmethod
    def _texts_of_names(cls, value: object) -> object:
        if not isinstance(value, Mapping):
            return value
        spelled = {}
        for field, texts in value.items():
            if field not in _SPELLED:
                raise ValueError(f"{field!r}, expected {', '.join(_SPELLED)}")
            if not isinstance(texts, Mapping):
                raise ValueError(f"{field}: expected a text for each name")
            of = {str(text_of_name(name)): composed(str(text_of_name(text))) for name, text in texts.items()}
            if field == "terrain":
                of = {terrain_text(parse_terrain(name)): text for name, text in of.items()}
            if len(set(of.values())) < len(of):
                raise ValueError(f"{field}: two names have the same text")
            spelled[field] = of
        return spelled

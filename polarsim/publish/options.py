"""Options of publishing."""

from __future__ import annotations

from pydantic import BaseModel, Field, ValidationInfo, field_validator

from polarsim.errors import ConfigError
from polarsim.publish.subset import parse_size, parse_subset


class PublishOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the target `publish`."""

    forms: tuple[str, ...] = Field(
        ("croissant", "coco"), description="Formats that the target `publish` writes; see docs/howto/publish.md."
    )
    subset: str = Field(
        "",
        description="Published images by fields of the photo key, such as terrain=1+3,exposure=256; empty: all images.",
    )
    max_size: str = Field("", description="Maximum size of each format, such as 2GB; empty: unlimited.")
    photos: bool = Field(
        False,
        description="Include the photos of the site, under the terms of their owner; always for the analog.",
    )

    @field_validator("forms")
    @classmethod
    def _known_forms(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        from polarsim.publish.forms import FORMS  # slow, imports all writers; not needed for the default

        for value in values:
            if value not in FORMS:
                raise ValueError(f"format {value!r}, expected one of {', '.join(FORMS)}")
        return values

    @field_validator("subset", "max_size")
    @classmethod
    def _readable(cls, value: str, field: ValidationInfo) -> str:
        try:
            if value:
                (parse_subset if field.field_name == "subset" else parse_size)(value)
        except ConfigError as error:
            raise ValueError(error.reason) from error
        return value

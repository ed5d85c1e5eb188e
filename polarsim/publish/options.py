"""What the configuration says about publishing."""

from __future__ import annotations

from pydantic import BaseModel, Field, field_validator

from polarsim.errors import ConfigError
from polarsim.publish.subset import parse_size, parse_subset


class PublishOptions(BaseModel, extra="forbid", frozen=True):
    """A run is published in these forms, which the target `publish` writes."""

    forms: tuple[str, ...] = Field(
        ("croissant", "coco"), description="Forms that the target `publish` writes; docs/howto/publish.md lists them."
    )
    subset: str = Field(
        "",
        description="Only pictures with these fields of their keys are published, such as "
        "terrain=1+3,exposure=256; empty: all are.",
    )
    max_size: str = Field("", description="Each form has at most this size, such as 2GB; empty: any.")
    photos: bool = Field(False, description="NASA's photos go out too, on NASA's terms; those of the analog always go.")

    @field_validator("forms")
    @classmethod
    def _known_forms(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        from polarsim.publish.forms import FORMS  # imports all writers: seconds, which the default does not need

        for value in values:
            if value not in FORMS:
                raise ValueError(f"form {value!r}, expected {', '.join(FORMS)}")
        return values

    @field_validator("subset")
    @classmethod
    def _readable_subset(cls, value: str) -> str:
        try:
            parse_subset(value)
        except ConfigError as error:
            raise ValueError(error.reason) from error
        return value

    @field_validator("max_size")
    @classmethod
    def _readable_size(cls, value: str) -> str:
        try:
            if value:
                parse_size(value)
        except ConfigError as error:
            raise ValueError(error.reason) from error
        return value

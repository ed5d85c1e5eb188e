"""Names of exposures, and of the image sets of a drive: `<Sun>_<model>_<exposure>`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

from polarsim.errors import FormatError

AUTO = "auto"  # the camera sets the exposure


def exposure_name(exposure_ms: float | str) -> str:
    """Return the name of an exposure, ms, at least four characters: `0256`, `12.5`, `1000000`; `auto` is unchanged.

    The name has all digits of the number: `float(exposure_name(x)) == x`.
    """
    if isinstance(exposure_ms, str):
        return exposure_ms
    text = f"{Decimal(repr(float(exposure_ms))):f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).zfill(4)


def exposure_order(name: str) -> tuple[bool, float]:
    """Return the sort key of an exposure's name: by milliseconds, words such as `auto` last."""
    return (True, 0.0) if name.isalpha() else (False, float(name))


def exposure_title(name: str) -> str:
    """Return the name of an exposure for figures."""
    return name if name == AUTO else f"{float(name):g} ms"


def sun_title(name: str) -> str:
    """Return the name of a Sun for figures."""
    return name if name == "night" else f"Sun {name}"


@dataclass(frozen=True)
class PictureSet:
    """Images of a view with the same Sun, reflectance model and exposure."""

    sun: str
    model: str  # reflectance model; the name may contain an underscore
    exposure_ms: float

    def __str__(self) -> str:
        return f"{self.sun}_{self.model}_{exposure_name(self.exposure_ms)}"

    @classmethod
    def parse(cls, name: str) -> PictureSet:
        """Parse the name of an image set."""
        sun, _, rest = name.partition("_")
        model, _, exposure = rest.rpartition("_")
        try:
            parsed = cls(sun, model, float(exposure))
            if not (sun and model and math.isfinite(parsed.exposure_ms) and parsed.exposure_ms > 0):
                raise ValueError
        except ValueError as error:
            raise FormatError(f"{name!r} is no name of an image set, expected SUN_MODEL_EXPOSURE") from error
        return parsed

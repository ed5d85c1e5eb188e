"""What figures of a rover that finds its own way call modes, Suns and exposures."""

from __future__ import annotations

MODES = ("truth", "detector", "stereo", "both", "blind")
ANY = "any"  # Sun of drives that take no pictures
ALL = "all"  # Suns, exposures and detectors together


def sun_title(sun: str) -> str:
    return sun if sun == "night" else f"Sun {sun}"

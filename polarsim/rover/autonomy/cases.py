"""Which drives there are: a name of each, `<mode>_<Sun>_<exposure>_seed<seed>`, and what a name says."""

from __future__ import annotations

from dataclasses import dataclass

from polarsim.rover.autonomy.options import AUTO, AutonomyOptions, Mode

ANY = "any"  # light of modes that take no pictures
UNLIT = ("truth", "blind")


@dataclass(frozen=True)
class Light:
    """Under which Sun, with which exposure."""

    sun: str
    exposure_ms: float | str


def cases(options: AutonomyOptions) -> list[str]:
    """Names of all drives, `<mode>_<Sun>_<exposure>_seed<seed>`; modes without pictures drive once a seed."""
    found = []
    for mode in options.modes:
        lights = [(ANY, ANY)] if mode in UNLIT else [
            (sun, f"{ms:04g}" if isinstance(ms, (int, float)) else ms)
            for sun in options.suns for ms in options.exposures_ms
        ]  # fmt: skip
        found += [f"{mode}_{sun}_{ms}_seed{seed}" for sun, ms in lights for seed in options.seeds]
    return found


def parsed(case: str) -> tuple[Mode, Light, int]:
    """Mode, light and seed of a case's name."""
    mode, sun, exposure, seed = case.split("_")
    shown = ("3", 256.0) if sun == ANY else (sun, exposure if exposure == AUTO else float(exposure))
    return mode, Light(*shown), int(seed.removeprefix("seed"))  # type: ignore[return-value]

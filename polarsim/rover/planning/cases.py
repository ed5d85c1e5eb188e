"""Which drives there are. Their names say what they depend on.

That is `<mode>_<Sun>_<exposure>_<lights>_<model>_<detector>_seed<N>`; by labels or blind it is `<mode>_seed<N>`, by
stereo there is no detector.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import cast

import pandas as pd

from polarsim.render.options import Model
from polarsim.rover.cameras.options import CameraSuiteOptions, Light, lights_ahead
from polarsim.rover.perception.options import Mode
from polarsim.rover.planning.options import ON, AutonomyOptions
from polarsim.rover.vehicle.table import Vehicle
from polarsim.run_files.picture_sets import AUTO, exposure_name
from polarsim.schemas.rover import ANY

AXES = ("mode", "sun", "exposure", "lights", "model", "detector")
UNLIT = ("truth", "blind")  # take no pictures
DETECTING = ("detector", "both")


@dataclass(frozen=True)
class Case:
    """One drive."""

    mode: Mode
    seed: int
    sun: str = ANY
    exposure: str = ANY
    lights: str = ANY
    model: str = ANY
    detector: str = ANY

    @property
    def name(self) -> str:
        axes = self.axes | {"model": self.model.replace("_", "-")}  # `_` separates the axes
        named = [value for value in axes.values() if value != ANY]
        return "_".join([*named, f"seed{self.seed}"])

    @property
    def axes(self) -> dict[str, str]:
        """What all tables know a drive by, beside its seed."""
        return {axis: getattr(self, axis) for axis in AXES}

    def light(self, vehicle: Vehicle) -> Light:
        """Return the light of the pictures, with the lights of a vehicle."""
        if self.sun == ANY:
            return Light("3", 256.0)
        exposure = self.exposure if self.exposure == AUTO else float(self.exposure)
        lights = lights_ahead(vehicle) if self.lights == ON else ()
        return Light(self.sun, exposure, lights, cast(Model, self.model))


def cases(
    options: AutonomyOptions, cameras: CameraSuiteOptions, seeds: Sequence[int], detectors: Sequence[str]
) -> list[Case]:
    """Return all drives by detectors of these names, all of a seed before the next, so that a part of them compares."""
    exposures = (AUTO,) if options.auto_exposure else tuple(map(exposure_name, cameras.exposures_ms))
    lights = list(product(cameras.suns, exposures, options.headlights, cameras.models))
    found = []
    for seed, mode in product(seeds, options.modes):
        axes: list[tuple[str, ...]] = [()] if mode in UNLIT else list(lights)
        if mode in DETECTING:
            axes = [(*light, name) for light in lights for name in detectors]
        found += [Case(mode, seed, *own) for own in axes]
    return found


def parsed(name: str) -> Case:
    """The drive of a name."""
    head, _, seed = name.rpartition("_seed")
    mode, *axes = head.split("_", len(AXES) - 1)
    named = dict(zip(AXES[1:], axes, strict=False))
    if "model" in named:
        named["model"] = named["model"].replace("-", "_")
    return Case(cast(Mode, mode), int(seed), **named)


def matched(drives: pd.DataFrame, axis: str) -> pd.DataFrame:
    """Rows of drives that were made at every level of an axis, all else alike; columns: some of `AXES`, and `seed`.

    So levels are compared over the same Suns, exposures, lights, models, detectors and seeds, also where not every
    combination was driven.
    """
    alike = [name for name in (*AXES, "seed") if name != axis and name in drives]
    levels = drives.groupby(alike)[axis].transform("nunique")
    return drives[levels == drives[axis].nunique()]

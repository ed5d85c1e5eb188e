"""The autonomous drives of a run and their names.

A name is `<mode>_<pose>_<Sun>_<exposure>_<lights>_<model>_<detector>_seed<N>`. A pose that is known is omitted, drives
without pictures lack Sun to model, and stereo lacks the detector.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, cast

from polarsim.render.options import Model
from polarsim.rover.cameras.options import CameraSuiteOptions, ImagingCondition, lights_ahead
from polarsim.rover.perception.options import MODES_WITH_DETECTOR, Mode
from polarsim.rover.planning.options import ON, AutonomyOptions, PoseSource
from polarsim.run_files.picture_sets import AUTO, exposure_name
from polarsim.schemas.rover import ANY, FUSED, KNOWN, POSES

if TYPE_CHECKING:
    import pandas as pd  # a plan imports this module, and pandas takes a third of a second

    from polarsim.rover.vehicle.table import Vehicle

AXES = ("mode", "sun", "exposure", "lights", "model", "detector", "pose")
MODES_WITHOUT_PICTURES = ("truth", "blind")  # unless the pose needs them


@dataclass(frozen=True)
class Case:
    """An autonomous drive."""

    mode: Mode
    seed: int
    sun: str = ANY
    exposure: str = ANY
    lights: str = ANY
    model: str = ANY
    detector: str = ANY
    pose: PoseSource = "truth"

    @property
    def name(self) -> str:
        axes = self.axes | {"model": self.model.replace("_", "-")}  # `_` separates the axes
        mode, pose = axes.pop("mode"), axes.pop("pose")
        named = [value for value in axes.values() if value != ANY]
        return "_".join([mode, *([] if pose == KNOWN else [pose]), *named, f"seed{self.seed}"])

    @property
    def has_pictures(self) -> bool:
        return self.mode not in MODES_WITHOUT_PICTURES or self.pose == FUSED

    @property
    def axes(self) -> dict[str, str]:
        """Columns of all tables that identify a drive, together with the seed."""
        return {axis: getattr(self, axis) for axis in AXES}

    def light(self, vehicle: Vehicle) -> ImagingCondition:
        """Return the light of the pictures, with the lights of a vehicle."""
        if self.sun == ANY:
            return ImagingCondition("3", 256.0)
        exposure = self.exposure if self.exposure == AUTO else float(self.exposure)
        lights = lights_ahead(vehicle) if self.lights == ON else ()
        return ImagingCondition(self.sun, exposure, lights, cast(Model, self.model))


def cases(
    options: AutonomyOptions, cameras: CameraSuiteOptions, seeds: Sequence[int], detectors: Sequence[str]
) -> list[Case]:
    """Return all drives with detectors of these names.

    All drives of a seed come before the next seed, so that a part of the list is comparable.
    """
    exposures = (AUTO,) if options.auto_exposure else tuple(map(exposure_name, cameras.exposures_ms))
    lights = list(product(cameras.suns, exposures, options.headlights, cameras.models))
    result = []
    for seed, mode, pose in product(seeds, options.modes, options.poses):
        if mode == "blind" and pose == FUSED:
            continue
        axes: list[tuple[str, ...]] = list(lights) if Case(mode, seed, pose=pose).has_pictures else [()]
        if mode in MODES_WITH_DETECTOR:
            axes = [(*light, name) for light in lights for name in detectors]
        result += [Case(mode, seed, pose=pose, **dict(zip(AXES[1:-1], values, strict=False))) for values in axes]
    return result


def parse_case(name: str) -> Case:
    """Return the drive with a name."""
    head, _, seed = name.rpartition("_seed")
    mode, _, rest = head.partition("_")
    pose, _, others = rest.partition("_")
    if pose not in POSES:
        pose, others = KNOWN, rest
    axes = others.split("_", len(AXES) - 3) if others else []
    named = dict(zip(AXES[1:-1], axes, strict=False))
    if "model" in named:
        named["model"] = named["model"].replace("-", "_")
    return Case(cast(Mode, mode), int(seed), **named, pose=cast(PoseSource, pose))


def matched_drives(drives: pd.DataFrame, axis: str) -> pd.DataFrame:
    """Return the drives whose other columns (of `AXES` and `seed`) occur with all levels of an axis.

    So levels are compared over the same Suns, exposures, lights, models, detectors and seeds, even if some combinations
    were not driven.
    """
    other_columns = [name for name in (*AXES, "seed") if name != axis and name in drives]
    levels = drives.groupby(other_columns)[axis].transform("nunique")
    return drives[levels == drives[axis].nunique()]

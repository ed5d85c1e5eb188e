"""Options of the detector on board and of its fine-tuning."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field

from polarsim.detect.options import PredictionOptions
from polarsim.user_path import UserPath

Mode = Literal["truth", "detector", "stereo", "both", "blind"]  # `formats.schemas.MODES`
FINE_TUNED = "fine_tuned"  # name of the detector that other drives have made of the one on board


class OnboardDetector(BaseModel, extra="forbid", frozen=True):
    """Weights of a detector, and how it is applied to the rover's pictures: no section of the configuration.

    A detector of the run is applied as the run's section `detect` says; others by these defaults.
    """

    weights: Path
    prediction: PredictionOptions = PredictionOptions()


def onboard_detector(options: Mapping[str, Any] | None) -> OnboardDetector | None:
    """Return the detector of options from a rule; None without a detector."""
    return None if options is None else OnboardDetector(**options)


class DriveTuningOptions(BaseModel, extra="forbid", frozen=True):
    """The detector on board is fine-tuned on labelled pictures of other drives first."""

    drives: tuple[UserPath, ...] = Field(
        (),
        description="Folders of drives of other runs, such as `results/OTHER/rover/seed0`. None: no fine-tuning.",
    )
    every: int = Field(1, ge=1, description="Step between pictures of a drive that are used.")
    windows: int = Field(3, ge=1, description="Number of windows cut from each picture. More make training longer.")
    epochs: int = Field(6, ge=1, description="Number of passes over the windows.")

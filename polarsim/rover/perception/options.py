"""Options of the onboard detector and of its fine-tuning."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field

from polarsim.detect.options import PredictionOptions
from polarsim.user_path import UserPath

Mode = Literal["truth", "detector", "stereo", "both", "blind"]  # as `schemas.rover.MODES`
MODES_WITH_DETECTOR = ("detector", "both")
FINE_TUNED = "fine_tuned"  # name of the onboard detector after fine-tuning on other drives


class OnboardDetector(BaseModel, extra="forbid", frozen=True):
    """Weights and prediction options of a detector; not a section of the configuration.

    A detector of the run uses the run's section `detect`, others the defaults.
    """

    weights: Path
    prediction: PredictionOptions = PredictionOptions()


def onboard_detector(options: Mapping[str, Any] | None) -> OnboardDetector | None:
    """Return the detector of a rule's options; None without a detector."""
    return None if options is None else OnboardDetector(**options)


class DriveTuningOptions(BaseModel, extra="forbid", frozen=True):
    """Fine-tuning of the onboard detector on labelled pictures of other drives."""

    drives: tuple[UserPath, ...] = Field(
        (),
        description="Folders of drives of other runs, such as `results/OTHER/rover/seed0`. Empty: no fine-tuning.",
    )
    every: int = Field(1, ge=1, description="Step between the pictures of a drive.")
    windows: int = Field(3, ge=1, description="Number of windows cut from each picture. More make training longer.")
    epochs: int = Field(6, ge=1, description="Number of passes over the windows.")

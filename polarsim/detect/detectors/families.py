"""Interface of the families of detectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from polarsim.detect.detectors.files import Detector
from polarsim.detect.options import PredictionOptions, TrainingOptions

# Images (b, h, w) uint8 of equal size, as returned by `frame` -> boxes (n, 6) float64 of each image: x0, y0, x1, y1 in
# px of the input, confidence, class; in descending order of confidence.
LoadedDetector = Callable[[np.ndarray], list[np.ndarray]]
# The same images -> probability of each class of `class_masks` in each cell, (b, classes, h / n, w / n) float32; a cell
# has n x n px.
LoadedMasks = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Training:
    """Parameters of a training."""

    dataset: Path  # folder written by `make_dataset`, read only
    folder: Path  # checkpoints; contains only files of the same training, if it was interrupted
    options: TrainingOptions
    prediction: PredictionOptions  # inference options of validation
    imgsz: int  # longer side of the images, px
    seed: int
    threads: int  # number of torch threads on a CPU


@dataclass(frozen=True)
class Trained:
    """Result of a training."""

    state: dict[str, Any]  # weights of the best validation, tensors by name in half precision
    curve: pd.DataFrame  # a row per epoch: epoch, losses, val_map50, val_map50_95, with masks also val_mask_iou


class Family(Protocol):
    """Family of detectors, implemented by a module."""

    def train(self, training: Training) -> Trained:
        """Train, or resume an interrupted training; divergence is a `DetectError`."""
        ...

    def load(self, detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:
        """Load a detector for inference; `folder` stores temporary files of the library until the process ends."""
        ...

    def load_masks(self, detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:
        """Load a detector for the inference of class masks; a detector without masks is a `DetectError`."""
        ...

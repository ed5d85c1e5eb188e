"""What every family of detectors can do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from polarsim.detect.detectors.files import Detector
from polarsim.detect.options import PredictionOptions, TrainingOptions

# Pictures (b, h, w) uint8 of one size, as `frame` makes them -> for each what is in it, (n, 6) float64: x0, y0, x1, y1
# in px of the picture, confidence, class; the surest first.
LoadedDetector = Callable[[np.ndarray], list[np.ndarray]]
# Such pictures -> the probability of each class of `formats.class_masks` in each cell, (b, classes, h / n, w / n)
# float32; a cell has n x n px.
LoadedMasks = Callable[[np.ndarray], np.ndarray]
MAX_BOXES = 300  # that a detector gives of a picture, the surest ones: as many as in YOLOv5's own validation


@dataclass(frozen=True)
class Training:
    """What a training is told."""

    dataset: Path  # folder that `make_dataset` wrote, read only
    folder: Path  # for checkpoints; what lies there is of this very training, stopped before its end
    options: TrainingOptions
    prediction: PredictionOptions  # how validation looks at pictures: as the test will
    imgsz: int  # longer side of the pictures, px
    seed: int
    threads: int  # of torch on a CPU


@dataclass(frozen=True)
class Trained:
    """What a training gives."""

    state: dict[str, Any]  # tensors by name in half precision: the weights of the best validation
    curve: pd.DataFrame  # a row an epoch: epoch, losses, val_map50, val_map50_95, and with masks val_mask_iou


class Family(Protocol):
    """A kind of detector: one module implements it."""

    def train(self, training: Training) -> Trained:
        """Train, or go on with what was stopped.

        Raises
        ------
        PolarsimError
            A broken data set or pretrained weights, or a training that diverges.
        """
        ...

    def load(self, detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:
        """A detector that is ready to predict; `folder` is for files of its library, until the process ends.

        Raises
        ------
        DetectError
            The weights do not fit the model.
        """
        ...

    def load_masks(self, detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:
        """What tells ground, rocks and shadows apart, pixel by pixel.

        Raises
        ------
        DetectError
            The weights do not fit the model, or it was trained without masks.
        """
        ...

"""Family of a model, loading of detectors, and model names in tables."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from polarsim.detect.calibration import calibrate_boxes
from polarsim.detect.detectors.devices import choose_device, computes_bfloat16, has_bfloat16, load_torch
from polarsim.detect.detectors.families import Family, LoadedDetector, LoadedMasks
from polarsim.detect.detectors.files import Detector
from polarsim.detect.fusion import fuse
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError

Predicted = TypeVar("Predicted")


def family(model: str) -> Family:
    """Return the family of a model allowed by `TrainingOptions.model`. Only this family is imported."""
    if _is_compact(model):
        from polarsim.detect.detectors import compact

        return compact
    from polarsim.detect.detectors import yolo

    return yolo


def load_detector(detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:
    """Load a detector with its calibration and the precision, mirroring and device of the options."""
    loaded = _in_precision(family(detector.model).load(detector, folder, options, threads), options)
    if options.mirrored:
        loaded = detect_with_mirror(loaded, options.nms_iou)
    return lambda pictures: [calibrate_boxes(rows, detector.calibration) for rows in loaded(pictures)]


def load_masks(detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:
    """Load mask inference with the precision, mirroring and device of the options, see `Family.load_masks`."""
    loaded = _in_precision(family(detector.model).load_masks(detector, options, threads), options)
    return segment_with_mirror(loaded) if options.mirrored else loaded


def _in_precision(
    loaded: Callable[[np.ndarray], Predicted], options: PredictionOptions
) -> Callable[[np.ndarray], Predicted]:
    """Return the detector with convolutions in `options.precision`; only `auto` depends on the processor."""
    device, torch = choose_device(options.device), load_torch()
    if options.precision == "bfloat16" and not has_bfloat16(device):
        raise DetectError(f"precision bfloat16: not supported by this {device}, choose auto or float32")
    bfloat16 = computes_bfloat16(options.precision, device)
    if not bfloat16 and device == "cpu":
        return loaded

    def predict(pictures: np.ndarray) -> Predicted:
        with (
            torch.autocast(device, torch.bfloat16)
            if bfloat16
            else torch.backends.cudnn.flags(enabled=True, deterministic=True, allow_tf32=False)  # torch's default: TF32
        ):
            return loaded(pictures)

    return predict


def detect_with_mirror(loaded: LoadedDetector, nms_iou: float) -> LoadedDetector:
    """Return a detector that merges the boxes of an image and the image mirrored left to right, see `fuse`."""

    def detect(pictures: np.ndarray) -> list[np.ndarray]:
        both = []
        for boxes, turned in zip(loaded(pictures), loaded(_mirrored(pictures)), strict=True):
            mirrored = turned.copy()
            mirrored[:, [0, 2]] = pictures.shape[2] - turned[:, [2, 0]]
            both.append(fuse([boxes, mirrored], nms_iou))
        return both

    return detect


def segment_with_mirror(loaded: LoadedMasks) -> LoadedMasks:
    """Return mask inference that averages the probabilities of an image and the mirrored image."""
    return lambda pictures: (loaded(pictures) + _mirrored(loaded(_mirrored(pictures)))) / np.float32(2)


def _mirrored(pictures: np.ndarray) -> np.ndarray:
    """Reverse the columns of images (..., w)."""
    return np.ascontiguousarray(pictures[..., ::-1])


def detector_name(model: str) -> str:
    """Return the name of a model in tables.

    The YOLOv5 models of Ultralytics have a newer anchor-free head and are therefore named YOLOv5u.
    """
    if _is_compact(model):
        return f"{model} (polarsim's own)"
    return f"{model} (YOLOv5u)" if model.startswith("yolov5") else model


def _is_compact(model: str) -> bool:
    return model.startswith("compact")

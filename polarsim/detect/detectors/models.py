"""Which family of detectors a model is of, and how tables name it."""

from __future__ import annotations

from pathlib import Path

from polarsim.detect.calibration import calibrated
from polarsim.detect.detectors.families import Family, LoadedDetector, LoadedMasks
from polarsim.detect.detectors.files import Detector
from polarsim.detect.mirrored import boxes_both_ways, masks_both_ways
from polarsim.detect.options import PredictionOptions


def family(model: str) -> Family:
    """The family of a model that `TrainingOptions.model` allows. Only what is asked for is imported."""
    if _is_compact(model):
        from polarsim.detect.detectors.compact import family as compact

        return compact
    from polarsim.detect.detectors.yolo import family as yolo

    return yolo


def load_detector(detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:
    """See `Family.load`; looks at mirrored pictures too where the options say so.

    Confidences are calibrated where the detector has a calibration.
    """
    loaded = family(detector.model).load(detector, folder, options, threads)
    if options.mirrored:
        loaded = boxes_both_ways(loaded, options.nms_iou)
    return lambda pictures: [calibrated(rows, detector.calibration) for rows in loaded(pictures)]


def load_masks(detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:
    """See `Family.load_masks`; looks at mirrored pictures too where the options say so."""
    loaded = family(detector.model).load_masks(detector, options, threads)
    return masks_both_ways(loaded) if options.mirrored else loaded


def detector_name(model: str) -> str:
    """A model as tables name it.

    Ultralytics builds YOLOv5's body with its later anchor-free head; the tables must not call that YOLOv5.
    """
    if _is_compact(model):
        return f"{model} (polarsim's own)"
    return f"{model} (YOLOv5u)" if model.startswith("yolov5") else model


def _is_compact(model: str) -> bool:
    return model.startswith("compact")

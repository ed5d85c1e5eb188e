"""Detectors of several families with a common interface, `families.Family`."""

from polarsim.detect.detectors.devices import choose_device, load_torch
from polarsim.detect.detectors.families import LoadedDetector, LoadedMasks, Trained, Training
from polarsim.detect.detectors.files import Detector, read_detector, write_detector
from polarsim.detect.detectors.models import detector_name, family, load_detector, load_masks

__all__ = [
    "Detector",
    "LoadedDetector",
    "LoadedMasks",
    "Trained",
    "Training",
    "choose_device",
    "detector_name",
    "family",
    "load_detector",
    "load_masks",
    "load_torch",
    "read_detector",
    "write_detector",
]  # fmt: skip

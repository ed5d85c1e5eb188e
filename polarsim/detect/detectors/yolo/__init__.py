"""Detectors of Ultralytics (AGPL-3.0)."""

from polarsim.detect.detectors.yolo.training import train
from polarsim.detect.detectors.yolo.weights import load, load_masks

__all__ = ["load", "load_masks", "train"]

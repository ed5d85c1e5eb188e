"""Ultralytics models as a family of detectors."""

from polarsim.detect.detectors.yolo.training import train
from polarsim.detect.detectors.yolo.weights import load, load_masks

__all__ = ["load", "load_masks", "train"]

"""Ultralytics' models as a family of judges."""

from polarsim.detect.judges.yolo.training import train
from polarsim.detect.judges.yolo.weights import load

__all__ = ["load", "train"]

"""The detector `compact` as a family of detectors."""

from polarsim.detect.detectors.compact.training import train
from polarsim.detect.detectors.compact.weights import load

__all__ = ["load", "train"]

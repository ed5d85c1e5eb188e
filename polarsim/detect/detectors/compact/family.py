"""The detector `compact` as a family of detectors."""

from polarsim.detect.detectors.compact.training import train
from polarsim.detect.detectors.compact.weights import load, load_masks

__all__ = ["load", "load_masks", "train"]

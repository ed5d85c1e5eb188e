"""Anchor-free detector `compact` in torch, under the licence of polarsim (BSD-3-Clause)."""

from polarsim.detect.detectors.compact.training import train
from polarsim.detect.detectors.compact.weights import load, load_masks

__all__ = ["load", "load_masks", "train"]

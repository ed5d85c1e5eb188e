"""The judge `compact` as a family of judges."""

from polarsim.detect.judges.compact.training import train
from polarsim.detect.judges.compact.weights import load

__all__ = ["load", "train"]

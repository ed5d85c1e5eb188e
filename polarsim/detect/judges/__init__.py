"""Judges: detectors of several families behind one interface, `families.Family`."""

from polarsim.detect.judges.devices import choose_device, load_torch
from polarsim.detect.judges.families import Detector, Trained, Training
from polarsim.detect.judges.files import Judge, read_judge, write_judge
from polarsim.detect.judges.models import family, judge_name

__all__ = [
    "Detector", "Judge", "Trained", "Training",
    "choose_device", "family", "judge_name", "load_torch", "read_judge", "write_judge",
]  # fmt: skip

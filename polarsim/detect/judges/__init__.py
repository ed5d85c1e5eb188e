"""Judges: detectors of several families behind one interface, `families.Family`."""

from polarsim.detect.judges.devices import choose_device, load_torch
from polarsim.detect.judges.families import Detector, Trained, Training, family, judge_name
from polarsim.detect.judges.files import Judge, read_judge, write_judge

__all__ = [
    "Detector", "Judge", "Trained", "Training",
    "choose_device", "family", "judge_name", "load_torch", "read_judge", "write_judge",
]  # fmt: skip

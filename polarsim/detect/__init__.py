"""Detectors as judges of the gap between domains: data sets, training, prediction, detection figures, IPD."""

"""Detectors and the gap that they show between domains: data sets, training, prediction, detection figures, IPD."""

"""Detectors trained on strewn scenes alone, tested on the real cover photos of terrains that they have not seen."""

"""polarsim: digital twins of NASA's POLAR photos, with labels, detectors and tables."""

__version__ = "0.2.0"

"""polarsim: digital twins of NASA's POLAR photos, and the labels, detectors and tables that come with them."""

__version__ = "0.1.0"

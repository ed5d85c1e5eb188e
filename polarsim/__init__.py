"""polarsim: digital twins of NASA's POLAR photos, and the labels, judges and tables that come with them."""

__version__ = "0.1.0"

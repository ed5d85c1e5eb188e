"""Pictures of the report, each from files to one PNG or two."""

from polarsim.report.figures.comparison import draw_comparison
from polarsim.report.figures.contact import draw_contact
from polarsim.report.figures.curves import draw_curves
from polarsim.report.figures.gap_rocks import draw_gap_rocks
from polarsim.report.figures.ipd_histogram import draw_ipd_histogram
from polarsim.report.figures.judges import draw_detection, draw_ipd
from polarsim.report.figures.labels import draw_label_errors
from polarsim.report.figures.offsets import draw_offsets
from polarsim.report.figures.reliability import draw_reliability
from polarsim.report.figures.residuals import draw_residuals
from polarsim.report.figures.terrain import draw_terrain

__all__ = [
    "draw_comparison",
    "draw_contact",
    "draw_curves",
    "draw_detection",
    "draw_gap_rocks",
    "draw_ipd",
    "draw_ipd_histogram",
    "draw_label_errors",
    "draw_offsets",
    "draw_reliability",
    "draw_residuals",
    "draw_terrain",
]

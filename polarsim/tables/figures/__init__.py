"""Pictures of the report, each from files to one PNG or two."""

from polarsim.tables.figures.comparison import draw_comparison
from polarsim.tables.figures.contact import draw_contact
from polarsim.tables.figures.curves import draw_curves
from polarsim.tables.figures.gap_rocks import draw_gap_rocks
from polarsim.tables.figures.ipd_histogram import draw_ipd_histogram
from polarsim.tables.figures.judges import draw_detection, draw_ipd
from polarsim.tables.figures.labels import draw_label_errors
from polarsim.tables.figures.offsets import draw_offsets
from polarsim.tables.figures.reliability import draw_reliability
from polarsim.tables.figures.residuals import draw_residuals
from polarsim.tables.figures.terrain import draw_terrain

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

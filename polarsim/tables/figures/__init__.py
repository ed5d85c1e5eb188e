"""Pictures of the report, each from files to one PNG."""

from polarsim.tables.figures.comparison import draw_comparison
from polarsim.tables.figures.judges import draw_detection, draw_ipd
from polarsim.tables.figures.labels import draw_label_errors
from polarsim.tables.figures.terrain import draw_crops, draw_meshes

__all__ = ["draw_comparison", "draw_crops", "draw_detection", "draw_ipd", "draw_label_errors", "draw_meshes"]

"""Stage 4, seed labels to labels of every photo: boxes, polygons and grey maps."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    LabelsOptions="options",
    propagate_labels="propagate",
    draw_masks="masks",
)

"""Tools for annotators: images with labels, and import and export of labels for annotation tools."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    Marks="overlay",
    draw_labels="overlay",
    add_legend="overlay",
    show_of_run="show",
)

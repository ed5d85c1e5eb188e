"""Tools for annotators: images with labels, and import and export of labels for annotation tools."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    OverlayStyle="overlay",
    draw_labels="overlay",
    add_legend="overlay",
    show_of_run="show",
)

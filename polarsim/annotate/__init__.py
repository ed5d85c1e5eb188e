"""Tools for annotators: labels drawn into pictures, and labels and pictures for editors."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    Marks="overlay",
    draw_labels="overlay",
    add_legend="overlay",
    show_of_run="show",
)

"""Tables, figures and results page of a run."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    compare_runs="evaluation_table",
    write_table="layout",
    markdown="layout",
)

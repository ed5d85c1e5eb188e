"""Tables, figures and results page of a run."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    compare_runs="evaluation_table",
    write_table="layout",
    markdown="layout",
)

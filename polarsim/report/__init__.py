"""What people read of a run: tables that papers quote, figures, one page of results."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    compare_runs="evaluation_table",
    write_table="layout",
    markdown="layout",
)

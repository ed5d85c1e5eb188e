"""The typer application, options that several commands share, and the entry point."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from polarsim.arguments import CheckedCommand, call, writes_file
from polarsim.reporting import reporting

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    help="Digital twins of photos of sandboxes that are lit like the lunar poles, such as NASA's POLAR: labels, "
    "meshes, ray-traced twins, detectors and tables. "
    "`run` runs the pipeline with Snakemake; the other commands run single steps or read the results.",
)

JsonFile = Annotated[
    Path | None, typer.Option("--json", callback=writes_file(), help="JSON file for the complete report.")
]
CONFIG_HELP = (
    "Configuration file or overlay; may be repeated. Later files override earlier files. Files without `source.kind` "
    "are applied to config/config.yaml."
)
ConfigFiles = Annotated[list[Path] | None, typer.Option("--configfile", help=CONFIG_HELP)]
DEFAULT = "polar"  # site; `polarsim.site` imports pydantic, which most commands do not need
Results = Annotated[Path, typer.Option(help="Folder of results.")]
SiteName = Annotated[
    str, typer.Option("--site", help="Site of the photos: the name of a site that polarsim ships, or a site file.")
]


def assignments(texts: list[str] | None) -> list[str] | None:
    """Return values of an option that are `KEY=VALUE` with a value in YAML; other values are a usage error."""
    from polarsim.config import parse_assignment
    from polarsim.errors import ConfigError

    for text in texts or ():
        try:
            parse_assignment(text)
        except ConfigError as error:
            raise typer.BadParameter(str(error)) from error
    return texts


def main() -> None:
    """Run the command line. Invalid input ends with exit code 1, a usage error with exit code 2, each with one line."""
    with reporting():
        sys.exit(call(app))


def commands_of(panel: str) -> Callable[..., Any]:
    """Return a decorator that adds a command to a panel of `--help`."""
    return partial(app.command, cls=CheckedCommand, rich_help_panel=panel)


def split_commas(text: str) -> list[str]:
    """Return the parts of a comma-separated option."""
    return [part.strip() for part in text.split(",") if part.strip()]


def print_table(columns: Iterable[object], rows: Iterable[Iterable[object]], title: str | None = None) -> None:
    """Print a table; long cells are wrapped at the width of the terminal."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for name in columns:
        table.add_column(str(name), overflow="fold")
    for row in rows:
        table.add_row(*map(str, row))
    Console(markup=False, highlight=False).print(table)


def core_count(text: str | int) -> int:
    """Parse a number of processor cores; `all` is the number that this process may use."""
    if text == "all":
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not str(text).isdecimal() or int(text) < 1:
        raise typer.BadParameter(f"{text!r}, expected 1 or more, or all")
    return int(text)


def _print_version(asked: bool) -> None:
    from polarsim import __version__

    if asked:
        typer.echo(f"polarsim {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001  the callback prints it
        bool,
        typer.Option("--version", "-V", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), nl=False)
        raise typer.Exit(2)

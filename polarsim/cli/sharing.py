"""Commands that export a run to formats of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import run_folder, writes_folder
from polarsim.cli.application import Results, commands_of, split_commas

command = commands_of("For other tools")


@command()
def publish(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")],
    out: Annotated[
        Path,
        typer.Argument(callback=writes_folder, help="Output folder, with a subfolder per format."),
    ],
    form: Annotated[
        list[str],
        typer.Option("--format", help="croissant, hf, parquet ..., or all; may be repeated or comma-separated."),
    ],
    subset: Annotated[
        str, typer.Option(help="Select images by fields of the photo key, for example terrain=1+3,exposure=256.")
    ] = "",
    max_size: Annotated[
        str, typer.Option(help="Maximum size per format, for example 2GB; exceeding scenes are excluded.")
    ] = "",
    photos: Annotated[
        bool,
        typer.Option(
            "--photos",
            help="Include the photos of the site, under the terms of their owner. Photos of the analog are always "
            "included.",
        ),
    ] = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Delete existing content of the output folders of these formats.")
    ] = False,
    split: Annotated[
        str, typer.Option(help="Split that defines train, val and test; default: the first split of the run.")
    ] = "",
    results: Results = Path("results"),
) -> None:
    """Publish a run as data sets in common formats, each with a data card. An interrupted call resumes."""
    from polarsim.publish.run import form_summary, publish_forms

    names = [name for text in form for name in split_commas(text)]
    parts = publish_forms(run_folder(results, run), out, names, subset, max_size, photos, replace, split)
    for name, part in parts.items():
        typer.echo(form_summary(name, part, out / name))

"""Commands that export a run to formats of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import run_folder, writes_file, writes_folder
from polarsim.cli.application import Results, commands_of, split_commas
from polarsim.photo import WIDTH
from polarsim.reporting import reporting

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
            "--photos", help="Include NASA's photos, under NASA's terms. Photos of the analog are always included."
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
    with reporting():  # typer handles Ctrl-C
        parts = publish_forms(run_folder(results, run), out, names, subset, max_size, photos, replace, split)
    for name, part in parts.items():
        typer.echo(form_summary(name, part, out / name))


@command()
def rerun(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")],
    station: Annotated[str, typer.Argument(help="Terrain and position, for example 03_A.")],
    out: Annotated[
        Path | None,
        typer.Option(callback=writes_file(".rrd"), help="Recording to write; default: <run>_<station>.rrd."),
    ] = None,
    results: Results = Path("results"),
) -> None:
    """Export a station as a Rerun recording: terrain, cameras, lamps, photos and twins with labels.

    Requires the extra `rerun`.
    """
    from polarsim.errors import ConfigError
    from polarsim.explore.recording import write_recording
    from polarsim.run_files.run import Run

    terrain, _, position = station.partition("_")
    if not terrain.isdigit() or not position:
        raise ConfigError(f"station {station!r}: expected terrain and position, for example 03_A")
    target = out or Path(f"{run}_{station}.rrd")
    count = write_recording(Run.at(run_folder(results, run)), int(terrain), position, target)
    typer.echo(f"{count} pictures in {target}; open it with: rerun {target}")


@command()
def fiftyone(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")],
    folder: Annotated[Path, typer.Argument(callback=writes_folder, help="New folder for the output.")],
    keys: Annotated[str, typer.Option(help="Select photos by key, for example '01_A_off_*_L_0256'.")] = "*",
    domain: Annotated[
        list[str] | None, typer.Option(help="photo, or the reflectance model of twins; may be repeated. Default: all.")
    ] = None,
    width: Annotated[int, typer.Option(min=240, max=WIDTH, help="Image width, px.")] = WIDTH,
    results: Results = Path("results"),
) -> None:
    """Export a run as a FiftyOne data set: photos and twins with labels and predictions."""
    from polarsim.explore.fiftyone import FORM, write_fiftyone
    from polarsim.run_files.run import Run

    count = write_fiftyone(Run.at(run_folder(results, run)), folder, pattern=keys, domains=domain or (), width=width)
    typer.echo(f"{count} samples in {folder}; fiftyone.Dataset.from_dir({str(folder)!r}, dataset_type={FORM})")

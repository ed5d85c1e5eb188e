"""Commands that write a run as other people's tools read it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import run_folder, writes_file, writes_folder
from polarsim.cli.application import Results, commands_of, listed
from polarsim.photo import WIDTH
from polarsim.reporting import reporting

command = commands_of("For other tools")


@command()
def publish(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")],
    out: Annotated[
        Path,
        typer.Argument(callback=writes_folder, help="Folder to write; every form gets a folder of its name in it."),
    ],
    form: Annotated[
        list[str], typer.Option("--format", help="croissant, hf, parquet ...; may be repeated, or with commas; all.")
    ],
    subset: Annotated[
        str, typer.Option(help="Only pictures with these fields of their keys, such as terrain=1+3,exposure=256.")
    ] = "",
    max_size: Annotated[
        str, typer.Option(help="Largest size of each form, such as 2GB; whole scenes are left out until it fits.")
    ] = "",
    photos: Annotated[
        bool, typer.Option("--photos", help="NASA's photos too, on NASA's terms; those of the analog always go.")
    ] = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="What another call published in the folder of a form goes.")
    ] = False,
    split: Annotated[
        str, typer.Option(help="Split whose parts become train, val and test; default: the run's first one.")
    ] = "",
    results: Results = Path("results"),
) -> None:
    """Write a run in forms that other people's tools read, each with its data card; a stopped call goes on."""
    from polarsim.publish.run import publish as write
    from polarsim.publish.run import summary

    names = [name for text in form for name in listed(text)]
    with reporting():  # typer keeps Ctrl-C to itself
        parts = write(run_folder(results, run), out, names, subset, max_size, photos, replace, split)
    for name, part in parts.items():
        typer.echo(summary(name, part, out / name))


@command()
def rerun(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")],
    station: Annotated[str, typer.Argument(help="Terrain and position, such as 03_A.")],
    out: Annotated[
        Path | None,
        typer.Option(callback=writes_file(".rrd"), help="Recording to write; default <run>_<station>.rrd here."),
    ] = None,
    results: Results = Path("results"),
) -> None:
    """Write a station as a Rerun recording: terrain, cameras, lamps, photos and twins with labels.

    Needs the extra `rerun`.
    """
    from polarsim.errors import ConfigError
    from polarsim.explore.recording import write_recording
    from polarsim.run_files.run import Run

    terrain, _, position = station.partition("_")
    if not terrain.isdigit() or not position:
        raise ConfigError(f"station {station!r}, expected terrain and position such as 03_A")
    target = out or Path(f"{run}_{station}.rrd")
    count = write_recording(Run.at(run_folder(results, run)), int(terrain), position, target)
    typer.echo(f"{count} pictures in {target}; open it with: rerun {target}")


@command()
def fiftyone(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")],
    folder: Annotated[Path, typer.Argument(callback=writes_folder, help="New folder to write.")],
    keys: Annotated[str, typer.Option(help="Only photos with keys like this, such as '01_A_off_*_L_0256'.")] = "*",
    domain: Annotated[
        list[str] | None, typer.Option(help="Only photo, or a model's twins; may be repeated. Default: all.")
    ] = None,
    width: Annotated[int, typer.Option(min=240, max=WIDTH, help="Width of the pictures, px.")] = WIDTH,
    results: Results = Path("results"),
) -> None:
    """Write a run as a FiftyOne data set: photos and twins with labels and predictions."""
    from polarsim.explore.fiftyone import FORM, write_fiftyone
    from polarsim.run_files.run import Run

    count = write_fiftyone(Run.at(run_folder(results, run)), folder, pattern=keys, domains=domain or (), width=width)
    typer.echo(f"{count} samples in {folder}; fiftyone.Dataset.from_dir({str(folder)!r}, dataset_type={FORM})")

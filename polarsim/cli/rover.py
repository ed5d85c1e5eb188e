"""Command that drives a rover over the terrains of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import writes_folder
from polarsim.cli.application import CONFIG_HELP, commands_of
from polarsim.photo import terrain_text

command = commands_of("Rover")


@command()
def drive(
    run: Annotated[
        str | None, typer.Argument(help="Name of the run, below results/; default: that of --configfile, else demo.")
    ] = None,
    configfile: Annotated[list[Path] | None, typer.Option("--configfile", help=CONFIG_HELP)] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the drive; default: the first of the configuration.")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="Render images and run the detector on board.")] = True,
    results: Annotated[Path, typer.Option(help="Folder of results, which contains the meshes of the run.")] = Path(
        "results"
    ),
    out: Annotated[
        Path | None,
        typer.Option(callback=writes_folder, help="Output folder; default: results/<run>/rover/seed<N>."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the renderer. Does not affect the output.")] = 1,
) -> None:
    """Simulate one drive over the terrains of a run: physics, images, detections, an MCAP bag and a URDF.

    The default configuration is stored in the run; --configfile replaces it, for example config/overlays/rover.yaml.
    The output folder must be empty or missing.
    """
    from polarsim.errors import ConfigError, PolarsimError
    from polarsim.extras import require

    require("mujoco")
    from polarsim.progress import progress_bar
    from polarsim.rover.run import run_drive_pipeline
    from polarsim.running.configuration import STORED, read_configs, run_and_config

    if configfile and run is None and results.is_dir():
        chosen = read_configs(configfile)
        run_folder = results / chosen.run
    else:
        run_folder, chosen = run_and_config(results, run, configfile or ())
    rover, number = chosen.rover, chosen.rover.seeds[0] if seed is None else seed
    if not configfile and not rover.run:
        raise ConfigError(
            "rover.run is false in this run: add --configfile config/overlays/rover.yaml",
            path=run_folder / STORED,
        )
    meshes = run_folder / chosen.closed_meshes
    for terrain in rover.world.terrains if rover.world.dem is None else ():
        if not (there := meshes / f"Terrain{terrain_text(terrain)}").is_dir():
            raise PolarsimError("no such folder of meshes; create the meshes with polarsim run", path=there)
    folder = out or run_folder / f"rover/seed{number}"
    if folder.exists() and any(folder.iterdir()):
        raise PolarsimError("the folder is not empty: remove it, or choose another with --out", path=folder)
    with progress_bar(f"drive {number}") as progress:
        metrics = run_drive_pipeline(
            meshes=meshes,
            folder=folder,
            options=rover,
            render=chosen.render,
            detector=chosen.detector_on_board(run_folder),
            seed=number,
            progress=progress,
            pictures=pictures,
            threads=threads,
        )
    for row in metrics.to_dict("records"):
        typer.echo(f"{row['metric']:24} {row['value']:.4g} {row['unit']}".rstrip())
    typer.echo(f"{metrics['ended'].iloc[0]}: {folder}")

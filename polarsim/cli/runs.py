"""Commands about runs of the pipeline: make one, look at it, compare it with others."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import STOPPED, refuse_existing_folder, run_folder, writes_file, writes_folder
from polarsim.cli.application import ConfigFiles, Results, commands_of, core_count
from polarsim.errors import PolarsimError
from polarsim.photo import WIDTH

command = commands_of("Runs of the pipeline")


@command(context_settings={"ignore_unknown_options": True})
def run(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            help="Stages (acquire, cameras, rocks, labels, render, detect, tables, geometry, gap, cover_photos, rover, "
            "rover_autonomy, publish) or files; default: all. Options that are not listed here go to snakemake."
        ),
    ] = None,
    configfile: ConfigFiles = None,
    config: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUE", help="A key of the configuration, the value as in YAML; may be repeated."),
    ] = None,
    cores: Annotated[
        int | None,
        typer.Option(parser=core_count, metavar="N|all", help="Processor cores; default: 2, or those of --profile."),
    ] = None,
    min_free: Annotated[
        float | None, typer.Option(min=0, help="Free space to start with, GB; default: an estimate of the run.")
    ] = None,
) -> None:
    """Run the workflow in this folder. The same command goes on where a run was stopped, killed, or out of disk.

    Exit code 0: all is there; 1: a job failed, or the run cannot start; 2: usage error; 130: stopped.
    """
    from polarsim.running.run import Call
    from polarsim.running.run import run as supervise
    from polarsim.running.targets import CallError

    words = targets or []
    asked = next((number for number, word in enumerate(words) if word.startswith("-")), len(words))
    call = Call(tuple(words[:asked]), tuple(configfile or ()), tuple(config or ()), cores, tuple(words[asked:]))
    try:
        code = supervise(call, None if min_free is None else round(1e9 * min_free))
    except CallError as error:
        raise typer.BadParameter(str(error)) from error
    if code:
        raise typer.Exit(code)


@command()
def report(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")] = "demo",
    configfile: ConfigFiles = None,
    cores: Annotated[
        int, typer.Option(parser=core_count, metavar="N|all", help="Processor cores.", show_default="1")
    ] = 1,
) -> None:
    """Make results/<run>/report.html, Snakemake's own, where a table or figure is newer than it, and print where
    everything lies: the tables, that report, and last results.html, the page to open first.

    The configuration is that of the run's last call, results/<run>/config.yaml, unless --configfile names another.
    """
    from polarsim.formats.files import writing
    from polarsim.running.configuration import STORED, config_of_run
    from polarsim.running.report import warn_of_other_configurations, write_report

    folder = run_folder(Path("results"), run)
    parts = sorted([*folder.glob("tables/*.*"), *folder.glob("figures/*.png")])
    if not parts:
        raise PolarsimError("no tables; polarsim run makes them", path=folder)
    page = folder / "report.html"
    if not Path("Snakefile").exists():
        raise PolarsimError("no Snakefile here: start in the clone that made the run", path=Path.cwd())
    config = config_of_run(folder, configfile or ())
    warn_of_other_configurations([path for path in parts if path.suffix == ".csv"], config.digest())
    sources = [*parts, *([stored] if (stored := folder / STORED).exists() else [])]
    if not page.exists() or page.stat().st_mtime < max(path.stat().st_mtime for path in sources):
        writes_file()(page)
        writes_folder(Path(".snakemake"))
        with writing(page) as temporary:
            write_report(folder, configfile or [stored], temporary, cores)
    first = folder / "results.html"
    for path in (*(path for path in parts if path.suffix == ".md"), page, *([first] if first.exists() else [])):
        typer.echo(str(path))


@command()
def compare(
    runs: Annotated[list[str], typer.Argument(help="Names of runs, below results/.")],
    out: Annotated[Path, typer.Option(callback=writes_file(), help="Table to write, without its ending.")] = Path(
        "comparison"
    ),
    common: Annotated[
        bool, typer.Option("--common/--all", help="Only metrics of a terrain that all runs have measured, or all.")
    ] = True,
    results: Results = Path("results"),
) -> None:
    """Put the evaluation of runs side by side, with differences to the first run: CSV, Markdown, LaTeX and Parquet."""
    from polarsim.report.evaluation_table import compare_runs, compared

    for form in (".csv", ".md", ".tex", ".parquet"):
        refuse_existing_folder(out.with_name(out.name + form))
    several = len(runs) > 1
    table = compare_runs(
        runs=[run_folder(results, run) for run in runs], stem=out, common=common and several, differences=several
    )
    if several:
        typer.echo(f"{' / '.join(runs)}, medians over the terrains that these runs have in common:")
        typer.echo("\n".join(compared(table, runs)))
    typer.echo(f"{out}.md")


@command()
def explore(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")] = "demo",
    out: Annotated[
        Path | None,
        typer.Option(
            callback=writes_folder,
            help="Write the page to this new folder, for any static host, instead of serving it.",
        ),
    ] = None,
    width: Annotated[int, typer.Option(min=240, max=WIDTH, help="Width of the pictures, px.")] = WIDTH // 2,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    results: Results = Path("results"),
) -> None:
    """Look at a run in the browser: photos, twins, labels, rocks in 3-D, detectors, drives; correct boxes.

    The page is served on this machine alone until Ctrl-C. It saves corrections in results/<run>/corrections, which
    `labels.corrections` reads.
    """
    from polarsim.explore.site import site, write_site
    from polarsim.run_files.run import Run

    chosen = Run.at(run_folder(results, run))
    if out:
        count = write_site(chosen, out, width)
        typer.echo(f"{count} files in {out}; any static host shows them: python -m http.server -d {out} -b 127.0.0.1")
        return
    import os
    import webbrowser

    from polarsim.explore.corrections import Corrections
    from polarsim.explore.server import server

    with server(site(chosen, width), port, Corrections(chosen)) as served:
        address = f"http://{served.server_address[0]!s}:{served.server_address[1]}/"
        typer.echo(f"{address}   Ctrl-C ends it")
        if browser:
            webbrowser.open(address)
        try:
            served.serve_until_stopped()
        except KeyboardInterrupt:
            typer.echo("ended")
    if served.busy:  # a picture on a disk that does not answer: no thread may outlive the interpreter
        sys.stdout.flush()
        os._exit(STOPPED)


@command()
def undo(
    drawing: Annotated[str, typer.Argument(metavar="KEY", help="Photo of a seed or of a correction.")],
    configfile: ConfigFiles = None,
    run: Annotated[str | None, typer.Option(help="Name of the run; default: that of --configfile, else demo.")] = None,
    results: Results = Path("results"),
) -> None:
    """Show what followed from one drawing, a seed or a correction, and how it is taken back.

    Labels of its terrain are propagated with and without it; results/<run>/labels/undone/KEY.parquet has what differs,
    which `polarsim explore` shows. The configuration is the run's stored one, unless --configfile names another.
    """
    from polarsim.errors import LabelError
    from polarsim.grid import selected_grid
    from polarsim.labels.propagate import PropagationInputs
    from polarsim.labels.seeds import read_corrections
    from polarsim.labels.undo import what_followed
    from polarsim.photo import PhotoKey, positions
    from polarsim.running.configuration import run_and_config

    key = PhotoKey.parse(drawing)
    folder, config = run_and_config(results, run, configfile or ())
    terrain = f"Terrain{key.terrain:02d}"
    seeds = folder / "acquire" / terrain / "seeds"
    if not (seeds / f"{key}.txt").exists() and key not in read_corrections(config.labels.corrections, key.terrain):
        raise LabelError(f"no seed and no correction of {key}", path=seeds)
    out = folder / "labels" / "undone" / f"{key}.parquet"
    writes_file()(out)
    here = [position for position in config.positions if position in positions(key.terrain)]
    found = what_followed(
        drawing=key,
        inputs=PropagationInputs(
            terrain=key.terrain,
            keys=selected_grid(key.terrain, here, config.grid),
            photos=folder / "acquire" / terrain / "photos.parquet",
            inventory=folder / "acquire" / terrain / "inventory.json",
            seeds=seeds,
            cameras=folder / "cameras" / terrain,
            meshes=folder / "meshes" / terrain,
        ),
        options=config.labels,
        out=out,
    )
    changes = found.groupby(["kind", "change"]).agg(labels=("key", "size"), photos=("key", "nunique"))
    for row in changes.reset_index().to_dict("records"):
        typer.echo(f"{row['kind']:7} {row['change']:6} {row['labels']:6} labels on {row['photos']} photos")
    typer.echo(
        f"{found['key'].nunique()} photos follow from {key}. To exclude it, put this key into the configuration of the "
        f"run and repeat `polarsim run`:\nlabels:\n  taken_back: [{', '.join([*config.labels.taken_back, str(key)])}]"
    )


@command()
def schema(
    views: Annotated[bool, typer.Option("--views", help="Of files of views, such as config/views.yaml.")] = False,
) -> None:
    """Print the configuration's JSON schema, with the meaning and unit of every key."""
    from polarsim.config import schema as of_configuration
    from polarsim.render.views.options import schema as of_views

    typer.echo(of_views() if views else of_configuration(), nl=False)

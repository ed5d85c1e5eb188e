"""Commands for runs of the pipeline: run, report, compare, explore, undo."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from polarsim.arguments import refuse_existing_folder, run_folder, writes_file, writes_folder
from polarsim.cli.application import ConfigFiles, Results, assignments, commands_of, core_count, print_table
from polarsim.errors import PolarsimError
from polarsim.photo import terrain_text
from polarsim.wording import counted, run_command

command = commands_of("Runs of the pipeline")


@command(context_settings={"ignore_unknown_options": True})
def run(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            help="Stages (acquire, cameras, rocks, labels, render, detect, tables), further stages (geometry, "
            "rock_sizes, rock_diameters, gap, before_after, cover_photos, real_tables, elsewhere, field_detector, "
            "rover, rover_autonomy, publish) or files; default: all. Unlisted options are passed to Snakemake."
        ),
    ] = None,
    configfile: ConfigFiles = None,
    config: Annotated[
        list[str] | None,
        typer.Option(
            callback=assignments,
            metavar="KEY=VALUE",
            help="Key of the configuration, value in YAML; may be repeated.",
        ),
    ] = None,
    cores: Annotated[
        int | None,
        typer.Option(
            parser=core_count, metavar="N|all", help="Number of processor cores; default: 2, or from --profile."
        ),
    ] = None,
    min_free: Annotated[
        float | None, typer.Option(min=0, help="Minimum free disk space, GB; default: estimated size of the run.")
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Show the output of Snakemake instead of the progress of the stages.")
    ] = False,
) -> None:
    """Run the workflow in this folder. An interrupted run resumes with the same command.

    Shows the progress of each stage: a live line on a terminal, otherwise a line every 30 seconds.

    Exit code 0: complete; 1: a job failed, or the run cannot start; 2: usage error; 130: stopped by the user.
    """
    from polarsim.running.run import Call, run_workflow
    from polarsim.running.targets import CallError

    words = targets or []
    asked = next((number for number, word in enumerate(words) if word.startswith("-")), len(words))
    call = Call(
        tuple(words[:asked]), tuple(configfile or ()), tuple(config or ()), cores, tuple(words[asked:]), verbose
    )
    try:
        code = run_workflow(call, None if min_free is None else round(1e9 * min_free))
    except CallError as error:
        raise typer.BadParameter(str(error)) from error
    if code:
        raise typer.Exit(code)


@command()
def report(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")] = "demo",
    configfile: ConfigFiles = None,
    cores: Annotated[
        int, typer.Option(parser=core_count, metavar="N|all", help="Number of processor cores.", show_default=True)
    ] = 1,
) -> None:
    """Update Snakemake's report results/<run>/report.html and list the paths of tables, report and results.html.

    The default configuration is stored in results/<run>/config.yaml; --configfile replaces it.
    """
    from polarsim.formats.files import writing
    from polarsim.running.configuration import STORED, config_of_run
    from polarsim.running.report import warn_of_other_configurations, write_report

    folder = run_folder(Path("results"), run)
    parts = sorted([*folder.glob("tables/*.*"), *folder.glob("figures/*.png")])
    if not parts:
        raise PolarsimError("no tables; create the tables with polarsim run", path=folder)
    page = folder / "report.html"
    if not Path("Snakefile").exists():
        raise PolarsimError("no Snakefile in this folder: start in the clone that created the run", path=Path.cwd())
    config, stored = config_of_run(folder, configfile or ()), folder / STORED
    files = configfile or [stored]
    warn_of_other_configurations([path for path in parts if path.suffix == ".csv"], config.digest(), files)
    sources = [*parts, *([stored] if stored.exists() else [])]
    if not page.exists() or page.stat().st_mtime < max(path.stat().st_mtime for path in sources):
        writes_file()(page)
        writes_folder(Path(".snakemake"))
        with writing(page) as temporary:
            write_report(folder, files, temporary, cores)
    first = folder / "results.html"
    for path in (*(path for path in parts if path.suffix == ".md"), page, *([first] if first.exists() else [])):
        typer.echo(str(path))


@command()
def compare(
    runs: Annotated[list[str], typer.Argument(help="Names of runs, below results/.")],
    out: Annotated[Path, typer.Option(callback=writes_file(), help="Table to write, without file extension.")] = Path(
        "comparison"
    ),
    common: Annotated[
        bool, typer.Option("--common/--all", help="Only metrics that all runs contain, or all metrics.")
    ] = True,
    results: Results = Path("results"),
) -> None:
    """Compare the metrics of several runs. Writes CSV, Markdown, LaTeX and Parquet.

    Prints the F1 of labels on the photos that the first run and each further run score, with 95 % intervals (also in
    OUT-labels.csv); without such photos, the first metrics of the table.
    """
    from polarsim.report.evaluation_table import compare_runs, comparison_lines
    from polarsim.report.label_comparison import compare_labels, comparison_layout

    of_labels = out.with_name(f"{out.name}-labels")
    for form in (".csv", ".md", ".tex", ".parquet"):
        for stem in (out, of_labels):
            refuse_existing_folder(stem.with_name(stem.name + form))
    several, folders = len(runs) > 1, [run_folder(results, run) for run in runs]
    table = compare_runs(runs=folders, stem=out, common=common and several, differences=several)
    labels = compare_labels(folders, of_labels) if several else table[:0]
    if len(labels):
        shown = comparison_layout(labels, runs[0]).drop(columns="photos")
        print_table(
            shown, shown.to_numpy(), "F1 of labels on the photos that both runs score, 95 % intervals in brackets"
        )
        typer.echo(f"{of_labels}.md")
    elif several:
        typer.echo(f"{' / '.join(runs)}, medians over the terrains of all these runs:")
        typer.echo("\n".join(comparison_lines(table, runs)))
    typer.echo(f"{out}.md")


@command()
def explore(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")] = "demo",
    out: Annotated[
        Path | None,
        typer.Option(
            callback=writes_folder,
            help="New folder for a static copy of the page; the page is not served.",
        ),
    ] = None,
    width: Annotated[
        int | None,
        typer.Option(
            min=240,
            max=16384,
            help="Image width, px; default: half of the photos' width, but 968 for photos of 968 to 1936 px.",
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Port on 127.0.0.1; 0: any free port; default: the same port for each start of a run.",
        ),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    results: Results = Path("results"),
) -> None:
    """Open an interactive view of a run in the browser: photos, twins, labels, 3-D rocks, detections, drives.

    Boxes can be corrected; corrections are stored in results/<run>/corrections for the option `labels.corrections`.
    The page is available only on this machine, until Ctrl-C.
    """
    from polarsim.explore.site import page_of_run, write_site
    from polarsim.run_files.run import Run

    chosen = Run.at(run_folder(results, run))
    if out:
        count = write_site(chosen, out, width)
        typer.echo(f"{count} files in {out}; view: python -m http.server -d {shlex.quote(str(out))} -b 127.0.0.1")
        return
    import os
    import webbrowser

    from polarsim.explore.corrections import Corrections
    from polarsim.explore.server import server_of_run

    corrections = Corrections(chosen)
    with server_of_run(chosen.folder, page_of_run(chosen, width), port, corrections) as served:
        address = f"http://{served.server_address[0]!s}:{served.server_address[1]}/"
        typer.echo(f"{address}   stop with Ctrl-C")
        if browser:
            webbrowser.open(address)
        try:
            served.serve_forever()
        except KeyboardInterrupt:
            corrections.finish()
            typer.echo("stopped")
            sys.stdout.flush()
            os._exit(0)  # with all threads: a thread in a C++ library aborts a process that exits otherwise


@command()
def undo(
    drawing: Annotated[str, typer.Argument(metavar="KEY", help="Photo key of a seed or correction.")],
    configfile: ConfigFiles = None,
    run: Annotated[str | None, typer.Option(help="Name of the run; default: from --configfile, else demo.")] = None,
    results: Results = Path("results"),
) -> None:
    """List the labels derived from a seed or correction and how to exclude it.

    The labels of the terrain are propagated with and without this photo; differences are stored in
    results/<run>/labels/undone/KEY.parquet. The default configuration is stored in the run.
    """
    from polarsim.errors import LabelError
    from polarsim.grid import selected_grid
    from polarsim.labels.propagate import PropagationInputs
    from polarsim.labels.seeds import read_corrections
    from polarsim.labels.undo import derived_labels
    from polarsim.running.configuration import STORED, run_and_config

    folder, config = run_and_config(results, run, configfile or ())
    key = config.site.key(drawing)
    terrain = f"Terrain{terrain_text(key.terrain)}"
    seeds = folder / "acquire" / terrain / "seeds"
    if not (seeds / f"{key}.txt").exists() and key not in read_corrections(
        config.labels.corrections, config.site, key.terrain
    ):
        raise LabelError(f"no seed and no correction of {key}", path=seeds)
    out = folder / "labels" / "undone" / f"{key}.parquet"
    writes_file()(out)
    found = derived_labels(
        drawing=key,
        inputs=PropagationInputs(
            site=config.site,
            terrain=key.terrain,
            keys=selected_grid(config.site, key.terrain, config.positions, config.grid),
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
        labels, photos = counted(row["labels"], "label"), counted(row["photos"], "photo")
        typer.echo(f"{row['kind']:7} {row['change']:6} {labels:>13} on {photos}")
    files = configfile or [folder / STORED]
    excluded = ", ".join([*config.labels.excluded_annotations, str(key)])
    command = run_command(files, settings=[f"labels={{excluded_annotations: [{excluded}]}}"])
    typer.echo(
        f"{counted(found['key'].nunique(), 'photo')} with labels derived from {key}. To exclude the annotation, add to "
        f"the configuration of the run:\nlabels:\n  excluded_annotations: [{excluded}]\n"
        f"or repeat the run once with:\n{command}"
    )


@command()
def schema(
    views: Annotated[
        bool, typer.Option("--views", help="Schema of files of views, for example config/views.yaml.")
    ] = False,
) -> None:
    """Print the JSON schema of the configuration, with description and unit of every key."""
    from polarsim.config import config_schema
    from polarsim.render.views.options import views_schema

    typer.echo(views_schema() if views else config_schema(), nl=False)

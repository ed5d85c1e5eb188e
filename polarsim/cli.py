"""The `polarsim` command. Heavy modules are imported by the commands that need them, so that --help is quick."""

from __future__ import annotations

import sys
from functools import partial
from json import dumps
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from polarsim.arguments import (
    PLOTS,
    Checked,
    call,
    refuse_existing_folder,
    run_folder,
    sun_above_horizon,
    writes_file,
    writes_folder,
)
from polarsim.errors import PolarsimError
from polarsim.photo import USUAL_EXPOSURE_MS
from polarsim.reporting import reporting

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    help="Digital twins of NASA's POLAR photos: labels, meshes, ray-traced twins, detectors and tables. "
    "`run` runs the pipeline, by snakemake; the other commands look at its parts.",
)
command = partial(app.command, cls=Checked)

Model = Literal["principled", "hapke", "lambert", "lunar_lambert", "hapke_chrono", "principled_chrono"]
Treatment = Literal["zero", "left_out"]  # what becomes of a rock
JsonFile = Annotated[
    Path | None, typer.Option("--json", callback=writes_file(), help="Write the whole report to this JSON file.")
]
Results = Annotated[Path, typer.Option(help="Folder of results.")]


def main() -> None:
    """Entry point: bad input ends in one line and exit code 1, a call that cannot be in one line and exit code 2."""
    with reporting():
        sys.exit(call(app))


def _print_version(asked: bool) -> None:
    from polarsim import __version__

    if asked:
        typer.echo(f"polarsim {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001  its callback does all
        bool,
        typer.Option("--version", "-V", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), nl=False)
        raise typer.Exit(2)


@command(context_settings={"ignore_unknown_options": True})
def run(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            help="Stages (labels, render, tables ...) or files; default: all. Options that are not listed here go to "
            "snakemake, after the targets."
        ),
    ] = None,
    configfile: Annotated[
        list[Path] | None,
        typer.Option(help="Configuration; may be repeated, later ones are laid over. Default: config/config.yaml."),
    ] = None,
    config: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUE", help="A key of the configuration, the value as in YAML; may be repeated."),
    ] = None,
    cores: Annotated[
        int | None, typer.Option(min=1, help="Processor cores; default: 2, or what --profile says.")
    ] = None,
    min_free: Annotated[
        float | None, typer.Option(min=0, help="Free space to start with, GB; default: an estimate of the run.")
    ] = None,
) -> None:
    """Run the workflow in this folder. The same command goes on where a run was stopped, killed, or out of disk.

    Exit code 0: all is there; 1: a job failed, or the run cannot start; 2: a call that cannot be; 130: stopped.
    """
    from polarsim.running.run import Call
    from polarsim.running.run import run as supervise

    words = targets or []
    asked = next((number for number, word in enumerate(words) if word.startswith("-")), len(words))
    if wrong := [word for word in words[:asked] if "=" in word]:
        raise typer.BadParameter(f"{wrong[0]!r} is no target: expected --config {wrong[0]}")
    call = Call(tuple(words[:asked]), tuple(configfile or ()), tuple(config or ()), cores, tuple(words[asked:]))
    if code := supervise(call, None if min_free is None else round(1e9 * min_free)):
        raise typer.Exit(code)


@command()
def validate(
    root: Annotated[
        Path,
        typer.Argument(
            help="Folder in the published release's layout (Labels/, SegmentationLabels/, TerrainMeshes/), or one with "
            "images/ and labels/ as YOLO trainers have it."
        ),
    ],
    select: Annotated[
        str, typer.Option(help="Only these rules: names, codes or their beginnings, severities; comma between them.")
    ] = "",
    ignore: Annotated[str, typer.Option(help="Not these rules, named in the same way.")] = "",
    form: Annotated[Literal["text", "json", "sarif"], typer.Option("--format", help="What is printed.")] = "text",
    json: JsonFile = None,
    fix: Annotated[
        Path | None,
        typer.Option(
            callback=writes_folder,
            help="Write a repaired copy to this new folder, with changes.csv; ROOT stays as it is.",
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes that share the terrains.")] = 2,
) -> None:
    """Look for defects in labels: names, boxes, polygons, siblings, geometry, light.

    Exit code 0: nothing but notes; 1: errors or warnings, or a folder that cannot be read; 2: a call that cannot be.
    """
    from polarsim.formats.files import write_json
    from polarsim.lint.folders import lint
    from polarsim.lint.rules import chosen

    try:
        names = chosen(_listed(select), _listed(ignore))
    except PolarsimError as error:
        raise typer.BadParameter(str(error)) from error
    report = lint(root, names, workers=workers, fix=fix)
    if json:
        write_json(json, report.as_json())
    if form == "text":
        typer.echo(report.as_text())
    else:
        content = report.as_json() if form == "json" else report.as_sarif()
        typer.echo(dumps(content, indent=1, ensure_ascii=False))
    if report.count("error", "warning"):
        raise typer.Exit(1)


@command()
def rules() -> None:
    """Print the rules of `validate`: code, severity, name, meaning, and what --fix does."""
    from polarsim.lint.folders import rule_lines

    typer.echo("\n".join(rule_lines()))


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


@command()
def score(
    truth: Annotated[
        Path, typer.Argument(help="Folder of YOLO box files that people drew, flat or with TerrainNN folders.")
    ],
    labels: Annotated[Path, typer.Argument(help="Folder of YOLO box files to score, of either form.")],
    threshold: Annotated[float, typer.Option(min=0.01, max=1, help="Least IoU of a pair.")] = 0.5,
    json: JsonFile = None,
) -> None:
    """Score box files: precision, recall, F1 and mean IoU of rocks and shadows, matched one to one in each file."""
    from polarsim.formats.files import write_json
    from polarsim.scoring.score import score_folders

    report = score_folders(truth, labels, threshold)
    if json:
        write_json(json, report)
    _print_scores(report)


@command()
def ipd(
    labels_a: Annotated[
        Path, typer.Argument(help="Labels of the first domain: a folder of YOLO files, or a Parquet table.")
    ],
    predictions_a: Annotated[
        Path,
        typer.Argument(help="What a detector sees there; YOLO files with the confidence as sixth field, or a table."),
    ],
    labels_b: Annotated[Path, typer.Argument(help="Labels of the second domain, files of the same names.")],
    predictions_b: Annotated[Path, typer.Argument(help="What the same detector sees there.")],
    confidence: Annotated[float, typer.Option(min=0, max=1, help="Least confidence of a prediction.")] = 0.25,
    undetected: Annotated[
        Treatment, typer.Option(help="A labelled rock that no prediction overlaps: IoU 0, or left out.")
    ] = "zero",
    unpaired: Annotated[
        Treatment, typer.Option(help="A rock labelled in one domain only: IoU 0 in the other, or left out.")
    ] = "left_out",
    missing: Annotated[
        Treatment, typer.Option(help="A labelled picture without predictions: nothing was found there, or left out.")
    ] = "left_out",
    pair_iou: Annotated[
        float, typer.Option(min=0.01, max=1, help="Without rock ids: least IoU of labels of the same rock.")
    ] = 0.5,
    unit: Annotated[
        Literal["view", "photo"] | None,
        typer.Option(help="What intervals draw; default: views where all names are photo keys, else photos."),
    ] = None,
    resamples: Annotated[int, typer.Option(min=100, help="Bootstrap samples.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the bootstrap.")] = 0,
    json: JsonFile = None,
) -> None:
    """Instance performance difference of a detector between two domains, with 95 % intervals.

    ipd: absolute value of the mean difference of IoU, as the paper's table; ipd_abs: mean of the absolute differences.
    """
    from polarsim.detect.ipd import Rules
    from polarsim.detect.sets import compare_sets
    from polarsim.formats.files import write_json

    report = compare_sets(
        (labels_a, labels_b),
        (predictions_a, predictions_b),
        confidence=confidence,
        rules=Rules(undetected, unpaired),
        unit=unit,
        pair_iou=pair_iou,
        missing=missing,
        seed=seed,
        resamples=resamples,
    )
    if json:
        write_json(json, report)
    _print_ipd(report)


@command()
def masks(
    polygons: Annotated[
        Path, typer.Argument(help="Folder of YOLO polygon files (0 background, 1 ground, 2 rock, 3 shadow).")
    ],
    out: Annotated[
        Path,
        typer.Argument(
            callback=writes_folder,
            help="Folder for the 8-bit grey maps: rock 128, ground 86, shadow 43, background 0.",
        ),
    ],
) -> None:
    """Paint polygon files as grey maps of 1936 x 1216 pixels; rocks last, so that nothing erases them."""
    from polarsim.errors import FormatError
    from polarsim.formats import png, yolo
    from polarsim.geometry.polygons import paint
    from polarsim.progress import track

    files = sorted(path for path in polygons.glob("*.txt") if path.name != "classes.txt")
    if not files:
        raise FormatError("no polygon file (*.txt)", path=polygons)
    for path in track(files, "grey maps"):
        png.write(out / f"{path.stem}.png", paint(yolo.read_polygons(path)))
    typer.echo(f"{len(files)} grey maps in {out}")


@command()
def outline(
    source: Annotated[Path, typer.Argument(help="COCO file of labels, results/<run>/labels/coco/TerrainNN.json.")],
    out: Annotated[Path, typer.Argument(callback=writes_file(), help="COCO file to write.")],
    simplify_px: Annotated[float, typer.Option(min=0, max=10, help="Farthest a dropped point may lie off, px.")] = 0.6,
) -> None:
    """Turn the masks of a COCO file into polygons: Label Studio's converter reads no others."""
    from polarsim.formats.coco import read_coco, write_coco

    photos = read_coco(source)
    write_coco(out, photos, simplify_px)
    typer.echo(f"{sum(map(len, photos.values()))} outlines on {len(photos)} photos in {out}")


@command()
def show(
    key: Annotated[str, typer.Argument(help="Photo key, such as 01_A_off_180_L_0256.")],
    run: Annotated[str, typer.Option(help="Name of the run, below results/.")] = "demo",
    domain: Annotated[str, typer.Option(help="photo, or a model that the run rendered (principled, hapke).")] = "photo",
    results: Results = Path("results"),
    out: Annotated[
        Path | None, typer.Option(callback=writes_file(".png"), help="PNG to write; default <key>_<domain>.png here.")
    ] = None,
    masks: Annotated[bool, typer.Option("--masks", help="Fill rocks and shadows with their colour.")] = False,
    kinds: Annotated[str, typer.Option(help="What is drawn: rock, shadow, or both with a comma.")] = "rock,shadow",
    scale: Annotated[float, typer.Option(min=0.04, max=8, help="Size of the picture over that of the photo.")] = 1.0,
) -> None:
    """Draw a photo or a twin with its labels to PNG: boxes, rock ids, confidences, lines from shadows to rocks."""
    from polarsim.annotate.show import show_of_run
    from polarsim.photo import PhotoKey

    photo, folder = PhotoKey.parse(key), run_folder(results, run)
    target = out or Path(f"{key}_{domain}.png")
    show_of_run(key=photo, run=folder, domain=domain, out=target, scale=scale, kinds=_listed(kinds), masks=masks)
    typer.echo(str(target))


@command()
def export(
    folder: Annotated[
        Path,
        typer.Argument(callback=writes_folder, help="New folder to write; one that holds something is refused."),
    ],
    run: Annotated[str, typer.Option(help="Name of the run, below results/.")] = "demo",
    terrain: Annotated[
        list[int] | None, typer.Option(min=1, max=13, help="Only this terrain; may be repeated.")
    ] = None,
    keys: Annotated[str, typer.Option(help="Only photos with keys like this, such as '01_A_off_*_L_0256'.")] = "*",
    tool: Annotated[
        Literal["labelimg", "cvat", "label-studio"], typer.Option(help="What is to open the folder.")
    ] = "labelimg",
    domain: Annotated[str, typer.Option(help="photo, or a model whose twins stand in for photos.")] = "photo",
    results: Results = Path("results"),
) -> None:
    """Write a run's photos, tone-mapped, with their labels to a folder in which people correct them."""
    from polarsim.annotate.export import export as write
    from polarsim.annotate.export import opening

    found = run_folder(results, run)
    count = write(folder=folder, run=found, terrains=terrain or (), pattern=keys, domain=domain, tool=tool)
    typer.echo(f"{count} pictures in {folder}\n{opening(folder, tool)}")


@command(name="import")
def import_(
    source: Annotated[Path, typer.Argument(help="Export of a labelling tool: a .json or .xml file, or a folder.")],
    folder: Annotated[
        Path,
        typer.Argument(
            callback=writes_folder, help="New folder of label files KEY.txt; one that holds something is refused."
        ),
    ],
    form: Annotated[
        Literal["auto", "coco", "yolo", "cvat", "label-studio", "fiftyone"],
        typer.Option("--format", help="What wrote it; auto: told by what it holds."),
    ] = "auto",
    use: Annotated[
        Literal["seeds", "corrections"], typer.Option("--as", help="What the labels shall be to a run.")
    ] = "corrections",
    name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CALLED=KIND", help="Another name of rock or shadow; CALLED= leaves it out; may be repeated."
        ),
    ] = None,
    keep_empty: Annotated[
        bool, typer.Option("--keep-empty", help="A photo without a box was looked at, and nothing is in it.")
    ] = False,
) -> None:
    """Take labels that others drew in COCO, YOLO, CVAT, Label Studio or FiftyOne as seeds or corrections of a run."""
    from polarsim.annotate.import_labels import import_labels
    from polarsim.photo import BOX_CLASSES

    names = {}
    for text in name or ():
        called, equals, kind = text.partition("=")
        if not called or not equals or kind not in ("", *BOX_CLASSES):
            raise typer.BadParameter(f"--name {text!r}: expected CALLED=rock, CALLED=shadow or CALLED=")
        names[called] = kind
    photos, boxes, empty = import_labels(source, folder, form, names, keep_empty)
    typer.echo(f"{boxes} boxes in {photos} photos in {folder}")
    if empty:
        some = ", ".join(empty[:3]) + (", ..." if len(empty) > 3 else "")
        typer.echo(f"{len(empty)} photos without a box were left out (--keep-empty takes them as seen): {some}")
    key = {"seeds": f"{{seeds: {{root: {folder}}}}}", "corrections": f"{{corrections: {folder}}}"}[use]
    typer.echo(f"in the run's configuration:  labels: {key}")


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
    results: Results = Path("results"),
) -> None:
    """Write a run in forms that other people's tools read, each with its data card; a stopped call goes on."""
    from polarsim.publish.run import publish as write
    from polarsim.publish.run import summary

    names = [name for text in form for name in _listed(text)]
    with reporting():  # typer keeps Ctrl-C to itself
        parts = write(run_folder(results, run), out, names, subset, max_size, photos, replace)
    for name, part in parts.items():
        typer.echo(summary(name, part, out / name))


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
    width: Annotated[int, typer.Option(min=240, max=1936, help="Width of the pictures, px.")] = 968,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    results: Results = Path("results"),
) -> None:
    """Look at a run in the browser: photos, twins, labels, rocks in 3-D, detectors, drives; correct boxes.

    The page is served on this machine alone until Ctrl-C.
    """
    from polarsim.explore.run import Run
    from polarsim.explore.site import site, write_site

    chosen = Run.at(run_folder(results, run))
    if out:
        count = write_site(chosen, out, width)
        typer.echo(f"{count} files in {out}; any static host shows them: python -m http.server -d {out} -b 127.0.0.1")
        return
    import webbrowser

    from polarsim.explore.server import server

    with server(site(chosen, width), port) as served:
        address = f"http://{served.server_address[0]!s}:{served.server_address[1]}/"
        typer.echo(f"{address}   Ctrl-C ends it")
        if browser:
            webbrowser.open(address)
        try:
            served.serve_forever()
        except KeyboardInterrupt:
            typer.echo("ended")


@command()
def undo(
    drawing: Annotated[str, typer.Argument(metavar="KEY", help="Photo of a seed or of a correction.")],
    configfile: Annotated[Path, typer.Option(help="Configuration of the run.")] = Path("config/config.yaml"),
    run: Annotated[str | None, typer.Option(help="Name of the run; default is the configuration's.")] = None,
    results: Results = Path("results"),
) -> None:
    """Show what followed from one drawing, a seed or a correction, and how it is taken back.

    Labels of its terrain are propagated with and without it; results/<run>/labels/undone/KEY.parquet has what differs,
    which `polarsim explore` shows.
    """
    from polarsim.config import read_config
    from polarsim.errors import LabelError
    from polarsim.grid import selected_grid
    from polarsim.labels.seeds import read_corrections
    from polarsim.labels.undo import what_followed
    from polarsim.photo import PhotoKey, positions

    key, config = PhotoKey.parse(drawing), read_config(configfile)
    folder, terrain = run_folder(results, run or config.run), f"Terrain{key.terrain:02d}"
    seeds = folder / "acquire" / terrain / "seeds"
    if not (seeds / f"{key}.txt").exists() and key not in read_corrections(config.labels.corrections, key.terrain):
        raise LabelError(f"no seed and no correction of {key}", path=seeds)
    here = [position for position in config.positions if position in positions(key.terrain)]
    found = what_followed(
        drawing=key,
        keys=selected_grid(key.terrain, here, config.grid),
        photos=folder / "acquire" / terrain / "photos.parquet",
        inventory=folder / "acquire" / terrain / "inventory.json",
        seeds=seeds,
        cameras=folder / "cameras" / terrain,
        meshes=folder / "meshes" / terrain,
        options=config.labels,
        out=folder / "labels" / "undone" / f"{key}.parquet",
    )
    changes = found.groupby(["kind", "change"]).agg(labels=("key", "size"), photos=("key", "nunique"))
    for row in changes.reset_index().to_dict("records"):
        typer.echo(f"{row['kind']:7} {row['change']:6} {row['labels']:6} labels on {row['photos']} photos")
    typer.echo(
        f"{found['key'].nunique()} photos follow from {key}. Taken back it is by these lines in the configuration, and "
        f"snakemake:\nlabels:\n  taken_back: [{', '.join([*config.labels.taken_back, str(key)])}]"
    )


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
    from polarsim.explore.run import Run

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
    width: Annotated[int, typer.Option(min=240, max=1936, help="Width of the pictures, px.")] = 1936,
    results: Results = Path("results"),
) -> None:
    """Write a run as a FiftyOne data set: photos and twins with labels and predictions."""
    from polarsim.explore.fiftyone import FORM, write_fiftyone
    from polarsim.explore.run import Run

    count = write_fiftyone(Run.at(run_folder(results, run)), folder, pattern=keys, domains=domain or (), width=width)
    typer.echo(f"{count} samples in {folder}; fiftyone.Dataset.from_dir({str(folder)!r}, dataset_type={FORM})")


@command()
def render(
    context: typer.Context,
    meshes: Annotated[
        Path,
        typer.Argument(
            metavar="MESHES|VIEWS.yaml",
            help="Folder of a terrain's meshes, results/<run>/meshes/TerrainNN; or a file of views such as "
            "config/views.yaml, for many pictures.",
        ),
    ],
    out: Annotated[
        Path, typer.Argument(help="16-bit PNG to write: 12-bit values, black level 16; of views: a folder.")
    ],
    terrain: Annotated[
        int | None, typer.Option(min=1, max=13, help="Number of the terrain; default: that of the meshes.")
    ] = None,
    camera: Annotated[tuple[float, float, float], typer.Option(help="Camera centre x y z, m, sandbox frame.")] = (
        3.6,
        -0.4,
        1.55,
    ),
    yaw: Annotated[float, typer.Option(help="Heading of the optical axis, deg from +X towards +Y.")] = 180.0,
    pitch: Annotated[float, typer.Option(min=-90, max=90, help="Downwards, deg.")] = 25.0,
    roll: Annotated[float, typer.Option(help="Right side down, deg.")] = 0.0,
    lamp: Annotated[tuple[float, float, float], typer.Option(help="Sun lamp x y z, m, sandbox frame.")] = (
        3.594,
        1.422,
        0.783,
    ),
    intensity: Annotated[
        float, typer.Option(min=0, help="Radiant intensity of the lamp over that of POLAR's Sun lamp.")
    ] = 1.0,
    lamp_radius: Annotated[float, typer.Option(min=0, help="Radius of the lamp's disc, m; 0: a point.")] = 0.0,
    sun: Annotated[
        tuple[float, float] | None,
        typer.Option(
            callback=sun_above_horizon,
            help="The Sun instead of the lamp: azimuth, deg from +X towards +Y, and elevation, deg above 0 up to 90.",
        ),
    ] = None,
    exposure: Annotated[float, typer.Option(min=0, help="Exposure time, ms.")] = USUAL_EXPOSURE_MS,
    model: Annotated[Model, typer.Option(help="Reflectance model.")] = "hapke",
    engine: Annotated[
        Literal["numpy", "taichi"] | None, typer.Option(help="Shading engine; default is the configuration's.")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE", help="Any key of the configuration's `render`, as samples=4; may be repeated."
        ),
    ] = None,
    cameras: Annotated[
        Path | None, typer.Option(help="PosX.json whose left lens is used; default is the real rig's stated one.")
    ] = None,
    preview: Annotated[bool, typer.Option("--preview", help="Write an 8-bit tone-mapped PNG instead.")] = False,
    maps: Annotated[
        Path | None,
        typer.Option(
            callback=writes_folder,
            help="Folder for 16-bit PNGs: depth (mm), normal, ids, angles (0.01 deg), shading, lit.",
        ),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads; they change no byte.")] = 1,
    limit: Annotated[int | None, typer.Option(min=1, help="Of views: only the first pictures.")] = None,
    scale: Annotated[
        float, typer.Option(min=0.01, max=4, help="Of views: size of the pictures over that of the lens.")
    ] = 1.0,
) -> None:
    """Render one scene: any camera pose, lamp position, exposure and reflectance model; or many, with labels, by a
    file of views. A JSON file beside each picture says what made it.
    """
    if meshes.suffix in (".yaml", ".yml"):
        _refuse_others(context, {"meshes", "out", "limit", "scale", "threads", "preview"})
        writes_folder(out)
        _render_views(meshes, out, limit, scale, preview, threads)
        return
    _refuse_others(context, set(context.params) - {"limit", "scale"})
    import numpy as np

    from polarsim.config import render_options
    from polarsim.formats import png
    from polarsim.formats.rigs import read_localised
    from polarsim.formats.scene import terrain_in
    from polarsim.formats.tone import to_8bit
    from polarsim.geometry.camera import Camera
    from polarsim.geometry.poses import looking
    from polarsim.geometry.stereo import stated_rig
    from polarsim.render.lamps import Lamp
    from polarsim.render.maps import write_maps
    from polarsim.render.scene import Scene, Shot
    from polarsim.render.sidecar import write_sidecar

    writes_file(".png")(out)
    sidecar = out.with_suffix(".json")
    refuse_existing_folder(sidecar)
    rig = read_localised(cameras).rig if cameras else stated_rig()
    shot = Shot(
        camera=Camera(looking(np.array(camera), *np.radians([yaw, pitch, roll])), rig.left),
        lamps={"sun": Lamp.sun(*sun, intensity) if sun else Lamp(np.array(lamp), intensity, lamp_radius)},
        exposure_ms=exposure,
        model=model,
    )
    assignments = [*(option or ()), *([f"engine={engine}"] if engine else ())]
    scene = Scene(meshes, terrain or terrain_in(meshes), render_options(assignments))
    scene.refuse_positions(shot)
    picture = scene.picture(shot, threads)
    png.write(out, to_8bit(picture) if preview else picture)
    write_sidecar(sidecar, scene.sidecar(shot))
    if maps:
        write_maps(maps, scene.maps(shot, threads))
    typer.echo(str(out))


def _render_views(file: Path, out: Path, limit: int | None, scale: float, preview: bool, threads: int) -> None:
    from functools import partial

    from polarsim.formats.tone import to_8bit
    from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
    from polarsim.render.views.options import read_views
    from polarsim.render.views.run import render_views

    tone = partial(to_8bit, white=WHITE_LEVEL - BLACK_LEVEL)  # one white for all: exposures stay apart
    with reporting():  # typer keeps Ctrl-C to itself
        count, new = render_views(
            read_views(file), out, tone=tone, limit=limit, scale=scale, preview=preview, threads=threads
        )
    typer.echo(f"{count} labelled pictures in {out}, {new} of them new; {out / 'contact.jpg'} shows them")


def _refuse_others(context: typer.Context, known: set[str]) -> None:
    """End where the call names an option that its form of the command does not have."""
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in known and source is not None and source.name == "COMMANDLINE":
            form = "one picture" if "limit" not in known else "a file of views"
            raise typer.BadParameter(f"--{name.replace('_', '-')} is no option with {form}")


@command()
def brdf(
    model: Annotated[Model, typer.Argument(help="Reflectance model.")],
    incidence: Annotated[float, typer.Option(min=0, max=90, help="Of the light, deg from the normal.")] = 30.0,
    emergence: Annotated[float, typer.Option(min=0, max=90, help="Of the view, deg from the normal.")] = 0.0,
    azimuth: Annotated[
        float, typer.Option(min=0, max=180, help="Between both, deg; 0: viewer on the lamp's side, 180: opposite.")
    ] = 0.0,
    soil: Annotated[
        str | None, typer.Option("--set", help="Parameter set of Hapke's models; default: chrono_lunar.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            callback=writes_file(*PLOTS),
            help="Draw it over the phase angle into this picture, for every set unless --set.",
        ),
    ] = None,
) -> None:
    """Print a reflectance, f_r in 1/sr, and the reflectance factor pi f_r (1: a perfectly white matt surface)."""
    import numpy as np

    from polarsim.render.goniometer import panels_of, parameters_of, phase_deg, reflectance_at
    from polarsim.render.options import HAPKE_SETS

    angles = (np.array([incidence]), np.array([emergence]), np.array([azimuth]))
    value = reflectance_at(parameters_of(model, soil), *angles)[0]
    typer.echo(f"phase   {phase_deg(*angles)[0]:.6g} deg")
    typer.echo(f"f_r     {value:.6g} 1/sr")
    typer.echo(f"pi f_r  {np.pi * value:.6g}")
    if plot:
        from polarsim.report.figures.brdf import draw_brdf

        names = list(HAPKE_SETS) if soil is None and model in ("hapke", "hapke_chrono") else [soil]
        chosen = {name or model: parameters_of(model, name) for name in names}
        draw_brdf(plot, panels_of(chosen, incidence))
        typer.echo(str(plot))


@command()
def detect(
    pictures: Annotated[
        list[Path], typer.Argument(help="Pictures, or folders of them; any size, 8 or 16 bits, grey or colour.")
    ],
    out: Annotated[Path, typer.Option(callback=writes_folder, help="New folder to write.")],
    weights: Annotated[
        list[Path] | None,
        typer.Option(
            help="Detector (.pt) that a run trained; default: the one that comes with polarsim. Of several, each named "
            "by its own --weights, what they find is merged; a box that one of two finds alone has half its confidence."
        ),
    ] = None,
    confidence: Annotated[float, typer.Option(min=0.001, max=0.99, help="Least confidence of a box.")] = 0.25,
    widths: Annotated[
        str, typer.Option(help="Widths at which a picture is looked at, px, comma between; default: the detector's.")
    ] = "",
    gates: Annotated[
        str, typer.Option(help="Between each two widths the box side where the wider one takes over, px of 1936.")
    ] = "",
    mirrored: Annotated[
        bool, typer.Option("--mirrored", help="Look at every picture mirrored too: finds more, takes twice as long.")
    ] = False,
    draw: Annotated[bool, typer.Option("--draw/--no-draw", help="Write the pictures with the boxes drawn.")] = True,
    masks: Annotated[
        bool,
        typer.Option("--masks", help="Write what every pixel shows too; for a detector that was trained with masks."),
    ] = False,
    device: Annotated[str, typer.Option(help="cpu, cuda, or auto.")] = "auto",
    threads: Annotated[int, typer.Option(min=1, help="Pictures looked at at a time, each by one thread.")] = 2,
) -> None:
    """Find rocks and shadows in anyone's pictures of ground under low light; boxes as CSV, YOLO and COCO."""
    from polarsim.detect.find import find_in_pictures, prediction_options
    from polarsim.detect.options import PACKAGED

    options = prediction_options(_listed(widths), _listed(gates), device, mirrored=mirrored)
    found = find_in_pictures(
        pictures=pictures, weights=weights or [PACKAGED], out=out, options=options, threads=threads,
        confidence=confidence, draw=draw, masks=masks,
    )  # fmt: skip
    counts = ", ".join(f"{(found['kind'] == kind).sum()} {kind}s" for kind in ("rock", "shadow"))
    typer.echo(f"{counts} in {out}")


@command()
def drive(
    config: Annotated[Path, typer.Option(help="Configuration with a section `rover`.")] = Path("config/rover.yaml"),
    seed: Annotated[int | None, typer.Option(min=0, help="Which drive; default is the configuration's first.")] = None,
    pictures: Annotated[bool, typer.Option(help="Take pictures, and run a detector on them on board.")] = True,
    results: Annotated[Path, typer.Option(help="Folder of results, with the run's meshes.")] = Path("results"),
    out: Annotated[
        Path | None,
        typer.Option(callback=writes_folder, help="Folder to write; default results/<run>/rover/seed<N>."),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the renderer; they change no byte.")] = 1,
) -> None:
    """Drive over a run's terrains once, without Snakemake: physics, pictures, what a detector sees, an MCAP bag, a
    URDF.

    A stopped drive goes on from its last saved state, pictures from the last one that was written.
    """
    from polarsim.config import read_config
    from polarsim.progress import share_bar
    from polarsim.rover.run import run_all

    chosen = read_config(config)
    rover, number = chosen.rover, chosen.rover.seeds[0] if seed is None else seed
    run = results / chosen.run
    folder = out or run / f"rover/seed{number}"
    with reporting(), share_bar(f"drive {number}") as progress:  # typer keeps Ctrl-C to itself
        figures = run_all(
            meshes=run / "meshes",
            folder=folder,
            options=rover,
            suite=chosen.cameras_on_board(run),
            seed=number,
            progress=progress,
            pictures=pictures,
            threads=threads,
        )
    for row in figures.to_dict("records"):
        typer.echo(f"{row['metric']:24} {row['value']:.4g} {row['unit']}".rstrip())
    typer.echo(f"{figures['ended'].iloc[0]}: {folder}")


@command()
def report(
    run: Annotated[str, typer.Argument(help="Name of the run, below results/.")] = "demo",
    configfile: Annotated[Path, typer.Option(help="Configuration of the run.")] = Path("config/config.yaml"),
    cores: Annotated[int, typer.Option(min=1, help="Processor cores.")] = 1,
) -> None:
    """Make results/<run>/report.html, Snakemake's own, where a table or figure is newer than it, and print where
    everything lies: the tables, that report, and last results.html, the page to open first.
    """
    import subprocess

    from polarsim.formats.files import writing

    folder = run_folder(Path("results"), run)
    parts = sorted([*folder.glob("tables/*.*"), *folder.glob("figures/*.png")])
    if not parts:
        raise PolarsimError("no tables; polarsim run makes them", path=folder)
    page = folder / "report.html"
    if not Path("Snakefile").exists():
        raise PolarsimError("no Snakefile here: start in the clone that made the run", path=Path.cwd())
    if not page.exists() or page.stat().st_mtime < max(path.stat().st_mtime for path in parts):
        with writing(page) as temporary:
            command = [
                *(sys.executable, "-m", "snakemake", "--cores", str(cores)),
                *("--configfile", str(configfile), "--report", str(temporary)),
            ]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise PolarsimError(f"snakemake --report failed: {' '.join(done.stderr.split())[-500:]}", path=page)
    first = folder / "results.html"
    for path in (*(path for path in parts if path.suffix == ".md"), page, *([first] if first.exists() else [])):
        typer.echo(str(path))


@command()
def compare(
    runs: Annotated[list[str], typer.Argument(help="Names of runs, below results/.")],
    out: Annotated[Path, typer.Option(callback=writes_file(), help="Table to write, without its ending.")] = Path(
        "comparison"
    ),
    results: Results = Path("results"),
) -> None:
    """Put the evaluation of several runs side by side: of other seeds, options, versions. In four forms."""
    from polarsim.report.evaluation_table import compare_runs

    for form in (".csv", ".md", ".tex", ".parquet"):
        refuse_existing_folder(out.with_name(out.name + form))
    compare_runs(runs=[run_folder(results, run) for run in runs], stem=out)
    typer.echo(f"{out}.md")


@command()
def schema(
    views: Annotated[bool, typer.Option("--views", help="Of files of views, such as config/views.yaml.")] = False,
) -> None:
    """Print the configuration's JSON schema, with the meaning and unit of every key."""
    from polarsim.config import schema as of_configuration
    from polarsim.render.views.options import schema as of_views

    typer.echo(of_views() if views else of_configuration(), nl=False)


def _print_scores(report: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("class", "files", "truth", "labels", "precision", "recall", "F1", "mean IoU")
    for name, row in report["classes"].items():
        counts = (str(row[figure]) for figure in ("files", "truth_boxes", "label_boxes"))
        ratios = (
            "-" if row[figure] is None else f"{row[figure]:.3f}" for figure in ("precision", "recall", "f1", "miou")
        )
        table.add_row(name, *counts, *ratios)
    Console().print(table)


def _print_ipd(report: dict[str, Any]) -> None:
    def shown(row: dict[str, Any], name: str) -> str:
        value, low, high = (row.get(column) for column in (name, f"{name}_low", f"{name}_high"))
        if value is None:
            return "-"
        return f"{value:.4f}" + (f" [{low:.4f}, {high:.4f}]" if low is not None and high is not None else "")

    rows = [["class", "pairs", f"{report['unit']}s", "IOU_mean A", "IOU_mean B", "ipd [95 %]", "ipd_abs [95 %]"]]
    for name, row in report["classes"].items():
        figures = [shown(row, key) for key in ("iou_mean_a", "iou_mean_b", "ipd", "ipd_abs")]
        rows.append([name, str(row["pairs"]), str(row["units"]), *figures])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for cells in rows:
        typer.echo("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip())
    for name in ("a", "b"):
        if unseen := report[f"without_predictions_{name}"]:
            some = ", ".join(unseen[:3]) + (", ..." if len(unseen) > 3 else "")
            how = "left out (--missing zero counts them)" if report["missing"] == "left_out" else "counted as IoU 0"
            typer.echo(f"{len(unseen)} labelled pictures have no predictions {name.upper()}, {how}: {some}")
    typer.echo(
        f"{report['pictures']} pictures; paired by {report['paired_by']}; confidence from {report['confidence']:g}; "
        f"undetected: {report['undetected']}; unpaired: {report['unpaired']}; intervals over {report['unit']}s"
    )

"""Commands about labels: check, score, draw, hand to people and take back."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from polarsim.arguments import run_folder, writes_file, writes_folder
from polarsim.cli.application import JsonFile, Results, commands_of, listed
from polarsim.errors import PolarsimError

command = commands_of("Labels")


@command()
def validate(
    root: Annotated[
        Path,
        typer.Argument(
            help="Folder in the published release's layout (Labels/, SegmentationLabels/, TerrainMeshes/), labels of a "
            "run, KEY.txt files, or pictures with label files (images/ and labels/, or together)."
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
            help="Write repaired label files to this new folder, with changes.csv; ROOT stays as it is.",
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
        names = chosen(listed(select), listed(ignore))
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
    if report.repairs is not None:
        typer.echo(f"{report.repairs} repairs in {fix}, listed in {fix}/changes.csv", err=form != "text")
    if report.count("error", "warning"):
        raise typer.Exit(1)


@command()
def rules() -> None:
    """Print the rules of `validate`: code, severity, name, meaning, and what --fix does."""
    from polarsim.lint.folders import rule_lines

    typer.echo("\n".join(rule_lines()))


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
    from polarsim.run_files.run import Run

    photo, folder = PhotoKey.parse(key), run_folder(results, run)
    target = out or Path(f"{key}_{domain}.png")
    show_of_run(key=photo, run=Run(folder), domain=domain, out=target, scale=scale, kinds=listed(kinds), masks=masks)
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
    source: Annotated[
        Path, typer.Argument(help="Export of a labelling tool: a .json or .xml file, a folder, or a zip archive.")
    ],
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
    done = import_labels(source, folder, form, names, keep_empty)
    *notes, counts = done.report()
    typer.echo("\n".join([f"{done.boxes} boxes in {done.photos} photos in {folder}", *notes]))
    key = {"seeds": f"{{seeds: {{root: {folder}}}}}", "corrections": f"{{corrections: {folder}}}"}[use]
    typer.echo(f"in the run's configuration:  labels: {key}\n{counts}")


@command()
def masks(
    polygons: Annotated[
        Path,
        typer.Argument(
            help="Folder of YOLO polygon files (0 background, 1 ground, 2 rock, 3 shadow), labels of a run, or a "
            "published folder."
        ),
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
    from polarsim.formats import png, release, yolo
    from polarsim.geometry.polygons import paint
    from polarsim.progress import track

    files = release.polygon_sources(polygons)
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

"""Commands for labels: validate, score, show, export and import."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from polarsim.arguments import run_folder, writes_file, writes_folder
from polarsim.cli.application import DEFAULT, JsonFile, Results, SiteName, commands_of, print_table, split_commas
from polarsim.errors import PolarsimError

command = commands_of("Labels")


@command()
def validate(
    root: Annotated[
        Path,
        typer.Argument(
            help="Folder in the layout of the published release, labels of a run, KEY.txt files, or images with label "
            "files (in images/ and labels/, or in one folder)."
        ),
    ],
    select: Annotated[
        str, typer.Option(help="Apply only these rules: names, code prefixes or severities, comma-separated.")
    ] = "",
    ignore: Annotated[
        str, typer.Option(help="Skip these rules: names, code prefixes or severities, comma-separated.")
    ] = "",
    form: Annotated[Literal["text", "json"], typer.Option("--format", help="Output format.")] = "text",
    json: JsonFile = None,
    fix: Annotated[
        Path | None,
        typer.Option(
            callback=writes_folder,
            help="New folder for repaired label files and changes.csv. ROOT is not modified and must contain "
            "Labels/TerrainNN/KEY.txt.",
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Number of processes, one terrain each.")] = 2,
    site: Annotated[
        str | None, typer.Option(help="Site of the photos, by name or file; default: that of the run, else polar.")
    ] = None,
) -> None:
    """Check labels for defects: names, boxes, polygons, consistency between photos, geometry, light.

    Exit code 0: no errors or warnings; 1: errors or warnings, or an unreadable folder; 2: usage error.
    """
    from polarsim.formats.files import write_json
    from polarsim.lint.folders import lint_folder
    from polarsim.lint.rules import select_rules
    from polarsim.site import read_site

    try:
        names = select_rules(split_commas(select), split_commas(ignore))
    except PolarsimError as error:
        raise typer.BadParameter(str(error)) from error
    report = lint_folder(root, names, site=None if site is None else read_site(site), workers=workers, fix=fix)
    if json:
        write_json(json, report.as_json())
    typer.echo(report.as_text() if form == "text" else dumps(report.as_json(), indent=1, ensure_ascii=False))
    if report.repairs is not None:
        typer.echo(f"{report.repairs} repairs in {fix}, listed in {fix}/changes.csv", err=form != "text")
    if report.count("error", "warning"):
        raise typer.Exit(1)


@command()
def rules() -> None:
    """List the rules of `validate`: code, severity, name, meaning and repair by --fix."""
    from polarsim.lint.folders import rule_lines

    typer.echo("\n".join(rule_lines()))


@command()
def score(
    truth: Annotated[Path, typer.Argument(help="Folder of annotated YOLO box files, flat or in TerrainNN folders.")],
    labels: Annotated[Path, typer.Argument(help="Folder of YOLO box files to score, flat or in TerrainNN folders.")],
    threshold: Annotated[float, typer.Option(min=0.01, max=1, help="Minimum IoU of matched boxes.")] = 0.5,
    site: SiteName = DEFAULT,
    json: JsonFile = None,
) -> None:
    """Compute precision, recall, F1 and mean IoU of boxes of rocks and shadows, matched one-to-one per file."""
    from polarsim.formats.files import write_json
    from polarsim.scoring.score import score_folders
    from polarsim.site import read_site

    report = score_folders(truth, labels, threshold, site=read_site(site))
    if json:
        write_json(json, report)
    _print_scores(report)


@command()
def show(
    key: Annotated[str, typer.Argument(help="Photo key, for example 01_A_off_180_L_0256.")],
    run: Annotated[str, typer.Option(help="Name of the run, below results/.")] = "demo",
    domain: Annotated[
        str, typer.Option(help="photo, or the reflectance model of a twin (principled, hapke).")
    ] = "photo",
    results: Results = Path("results"),
    out: Annotated[
        Path | None, typer.Option(callback=writes_file(".png"), help="PNG to write; default: <key>_<domain>.png.")
    ] = None,
    masks: Annotated[bool, typer.Option("--masks", help="Fill rocks and shadows with colour.")] = False,
    kinds: Annotated[str, typer.Option(help="Classes to draw, comma-separated: rock, shadow.")] = "rock,shadow",
    scale: Annotated[float, typer.Option(min=0.04, max=8, help="Image size relative to the photo.")] = 1.0,
) -> None:
    """Draw a photo or twin with labels: boxes, rock ids, confidences below 0.9, lines from shadows to rocks.

    Writes a PNG.
    """
    from polarsim.annotate.show import show_of_run
    from polarsim.run_files.run import Run

    chosen = Run(run_folder(results, run))
    photo, target = chosen.site.key(key), out or Path(f"{key}_{domain}.png")
    show_of_run(key=photo, run=chosen, domain=domain, out=target, scale=scale, kinds=split_commas(kinds), masks=masks)
    typer.echo(str(target))


@command()
def export(
    folder: Annotated[
        Path,
        typer.Argument(callback=writes_folder, help="New folder for the output; must be empty or missing."),
    ],
    run: Annotated[str, typer.Option(help="Name of the run, below results/.")] = "demo",
    terrain: Annotated[list[str] | None, typer.Option(help="Select a terrain; may be repeated.")] = None,
    keys: Annotated[str, typer.Option(help="Select photos by key, for example '01_A_off_*_L_0256'.")] = "*",
    tool: Annotated[
        Literal["labelimg", "cvat", "label-studio"], typer.Option(help="Labelling tool that opens the folder.")
    ] = "labelimg",
    domain: Annotated[
        str, typer.Option(help="photo, or a reflectance model whose twins replace the photos.")
    ] = "photo",
    results: Results = Path("results"),
) -> None:
    """Export tone-mapped photos and labels of a run for correction in a labelling tool."""
    from polarsim.annotate.export import export_photos, opening
    from polarsim.photo import parse_terrain

    found = run_folder(results, run)
    terrains = [parse_terrain(text) for text in terrain or ()]
    count = export_photos(folder=folder, run=found, terrains=terrains, pattern=keys, domain=domain, tool=tool)
    typer.echo(f"{count} images in {folder}\n{opening(folder, tool)}")


@command(name="import")
def import_(
    source: Annotated[
        Path, typer.Argument(help="Export of a labelling tool: a .json or .xml file, a folder, or a zip archive.")
    ],
    folder: Annotated[
        Path,
        typer.Argument(callback=writes_folder, help="New folder for label files KEY.txt; must be empty or missing."),
    ],
    form: Annotated[
        Literal["auto", "coco", "yolo", "cvat", "label-studio"],
        typer.Option("--format", help="Format of the source; auto: detected from the content."),
    ] = "auto",
    use: Annotated[
        Literal["seeds", "corrections"], typer.Option("--as", help="Role of the labels in a run.")
    ] = "corrections",
    name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CALLED=KIND", help="Map a class name to rock or shadow; CALLED= skips it; may be repeated."
        ),
    ] = None,
    keep_empty: Annotated[
        bool, typer.Option("--keep-empty", help="Import photos without boxes as annotated photos without objects.")
    ] = False,
    site: SiteName = DEFAULT,
) -> None:
    """Import annotations from COCO, YOLO, CVAT or Label Studio as seeds or corrections."""
    from polarsim.annotate.import_labels import import_labels
    from polarsim.photo import BOX_CLASSES
    from polarsim.site import read_site

    names = {}
    for text in name or ():
        called, equals, kind = text.partition("=")
        if not called or not equals or kind not in ("", *BOX_CLASSES):
            raise typer.BadParameter(f"--name {text!r}: expected CALLED=rock, CALLED=shadow or CALLED=")
        names[called] = kind
    done = import_labels(source, folder, form, names, keep_empty, site=read_site(site))
    *notes, counts = done.report()
    typer.echo("\n".join([f"{done.boxes} boxes in {done.photos} photos in {folder}", *notes]))
    key = {"seeds": f"{{seeds: {{root: {folder}}}}}", "corrections": f"{{corrections: {folder}}}"}[use]
    typer.echo(f"configuration of the run:  labels: {key}\n{counts}")


@command()
def masks(
    polygons: Annotated[
        Path,
        typer.Argument(
            help="Folder of YOLO polygon files (0 background, 1 ground, 2 rock, 3 shadow), labels of a run, or a "
            "published release."
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(
            callback=writes_folder,
            help="Folder for 8-bit class masks: rock 128, ground 86, shadow 43, background 0.",
        ),
    ],
    site: SiteName = DEFAULT,
) -> None:
    """Convert polygons to class masks (grey levels) of the size of the site's photos. Rocks overwrite other classes.

    Writes a sheet of the first masks in colour next to the folder, `OUT_preview.png`.
    """
    from polarsim.formats import png, release, yolo
    from polarsim.formats.mask_sheet import MAX_TILES, tile_of_mask, write_mask_sheet
    from polarsim.geometry.polygons import paint
    from polarsim.progress import track
    from polarsim.site import read_site

    size = read_site(site).images.size
    files = release.polygon_sources(polygons)
    tiles: dict[str, Any] = {}
    for path in track(files, "class masks"):
        grey = paint(yolo.read_polygons(path, size), size[::-1])
        png.write_png(out / f"{path.stem}.png", grey)
        if len(tiles) < MAX_TILES:
            tiles[path.stem] = tile_of_mask(grey)
    preview = out.with_name(f"{out.name}_preview.png")
    write_mask_sheet(preview, tiles)
    typer.echo(f"{len(files)} class masks in {out}; in colour: {preview}")


@command()
def outline(
    source: Annotated[Path, typer.Argument(help="COCO file of labels, results/<run>/labels/coco/TerrainNN.json.")],
    out: Annotated[Path, typer.Argument(callback=writes_file(), help="COCO file to write.")],
    simplify_px: Annotated[
        float, typer.Option(min=0, max=10, help="Maximum distance of removed points from the polygon, px.")
    ] = 0.6,
    site: SiteName = DEFAULT,
) -> None:
    """Convert masks of a COCO file to polygons, for tools that do not read masks."""
    from polarsim.formats.coco import read_coco, write_coco
    from polarsim.site import read_site

    chosen = read_site(site)
    photos = read_coco(source, chosen.images.size, chosen.key_of_picture)
    write_coco(out, photos, chosen, chosen.images.size, simplify_px=simplify_px)
    typer.echo(f"{sum(map(len, photos.values()))} outlines on {len(photos)} photos in {out}")


def _print_scores(report: dict[str, Any]) -> None:
    rows = []
    for name, row in report["classes"].items():
        ratios = [row[metric] for metric in ("precision", "recall", "f1", "miou")]
        shown = ["-" if ratio is None else f"{ratio:.3f}" for ratio in ratios]
        rows.append([name, *(row[metric] for metric in ("files", "truth_boxes", "label_boxes")), *shown])
    print_table(["class", "files", "truth", "labels", "precision", "recall", "F1", "mean IoU"], rows)

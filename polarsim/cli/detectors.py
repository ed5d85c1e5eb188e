"""Commands that run a detector on pictures, and compare it between two domains."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from polarsim.arguments import writes_folder
from polarsim.cli.application import JsonFile, commands_of, listed

command = commands_of("Detectors")
Treatment = Literal["zero", "left_out"]  # what becomes of a rock


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
    precision: Annotated[
        Literal["float32", "bfloat16"],
        typer.Option(help="Precision of the convolutions. bfloat16 needs a processor with instructions for it."),
    ] = "float32",
    threads: Annotated[int, typer.Option(min=1, help="Pictures looked at at a time, each by one thread.")] = 2,
) -> None:
    """Find rocks and shadows in anyone's pictures of ground under low light; boxes as CSV, YOLO and COCO."""
    from polarsim.detect.detect_pictures import find_in_pictures, prediction_options
    from polarsim.detect.detectors import choose_device
    from polarsim.detect.options import PACKAGED

    options = prediction_options(listed(widths), listed(gates), device, mirrored=mirrored, precision=precision)
    found = find_in_pictures(
        pictures=pictures, weights=weights or [PACKAGED], out=out, options=options, threads=threads,
        confidence=confidence, draw=draw, masks=masks,
    )  # fmt: skip
    counts = ", ".join(f"{(found['kind'] == kind).sum()} {kind}s" for kind in ("rock", "shadow"))
    typer.echo(f"precision {precision}, device {choose_device(device)}")
    typer.echo(f"{counts} in {out}")


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
    from polarsim.detect.external_sets import compare_sets
    from polarsim.detect.ipd import Rules
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
    boxes = "; ".join(
        f"{name} A {row['labels_a']}, B {row['labels_b']}, pairs {row['pairs']}"
        for name, row in report["classes"].items()
    )
    typer.echo(
        "IOU_mean is over all ground truth boxes of a domain, ipd over the common pairs of both domains, so ipd may "
        f"differ from the difference of the IOU_means: {boxes}"
    )
    for name in ("a", "b"):
        if unseen := report[f"without_predictions_{name}"]:
            some = ", ".join(unseen[:3]) + (", ..." if len(unseen) > 3 else "")
            how = "left out (--missing zero counts them)" if report["missing"] == "left_out" else "counted as IoU 0"
            typer.echo(f"{len(unseen)} labelled pictures have no predictions {name.upper()}, {how}: {some}")
    typer.echo(
        f"{report['pictures']} pictures; paired by {report['paired_by']}; confidence from {report['confidence']:g}; "
        f"undetected: {report['undetected']}; unpaired: {report['unpaired']}; intervals over {report['unit']}s"
    )

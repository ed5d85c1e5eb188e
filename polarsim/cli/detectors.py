"""Commands that run a detector on images and compare detections between two domains."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from polarsim.arguments import writes_folder
from polarsim.cli.application import JsonFile, commands_of, split_commas
from polarsim.photo import REFERENCE_WIDTH_PX
from polarsim.wording import counted

command = commands_of("Detectors")
Treatment = Literal["zero", "left_out"]  # IoU 0, or excluded


@command()
def detect(
    pictures: Annotated[
        list[Path], typer.Argument(help="Images or folders of images; any size, 8 or 16 bits, grey or colour.")
    ],
    out: Annotated[Path, typer.Option(callback=writes_folder, help="New folder for the output.")],
    weights: Annotated[
        list[Path] | None,
        typer.Option(
            help="Detector (.pt) trained by a run; default: a packaged detector, chosen for each image. May be "
            "repeated: detections are merged, and a box of only one of two detectors has half the confidence."
        ),
    ] = None,
    confidence: Annotated[float, typer.Option(min=0.001, max=0.99, help="Confidence threshold.")] = 0.25,
    widths: Annotated[
        str, typer.Option(help="Inference widths, px, comma-separated; default: stored in the detector.")
    ] = "",
    gates: Annotated[
        str,
        typer.Option(
            help="Box side at which the next larger width is used, px of an image "
            f"{REFERENCE_WIDTH_PX} px wide, comma-separated."
        ),
    ] = "",
    mirrored: Annotated[
        bool, typer.Option("--mirrored", help="Also run on mirrored images: higher recall, twice the time.")
    ] = False,
    draw: Annotated[bool, typer.Option("--draw/--no-draw", help="Write images with boxes and confidences.")] = True,
    masks: Annotated[
        bool,
        typer.Option("--masks", help="Also write class masks. Detectors of --weights must be trained with masks."),
    ] = False,
    device: Annotated[str, typer.Option(help="cpu, cuda, or auto.")] = "auto",
    precision: Annotated[
        Literal["float32", "bfloat16"],
        typer.Option(help="Precision of convolutions. bfloat16 requires a processor that supports it."),
    ] = "float32",
    threads: Annotated[int, typer.Option(min=1, help="Number of images processed in parallel.")] = 2,
) -> None:
    """Detect rocks and shadows in images. Writes boxes as CSV, YOLO and COCO.

    Tested on POLAR's cover photos of excluded terrains: mAP@0.5 of rocks 0.77. Images unlike POLAR's are searched by
    another packaged detector, with a warning: on photos of the Curiosity rover in daylight, AP@0.5 of rocks is 0.163.
    """
    from polarsim.annotate.detections import draw_detections
    from polarsim.detect.detect_pictures import detect_in_images, prediction_options
    from polarsim.detect.detectors import choose_device
    from polarsim.detect.options import PACKAGED, PACKAGED_FIELD
    from polarsim.errors import DetectError

    try:
        options = prediction_options(
            split_commas(widths), split_commas(gates), device, mirrored=mirrored, precision=precision
        )
    except DetectError as error:
        raise typer.BadParameter(_by_option(error.reason)) from error
    found = detect_in_images(
        pictures=pictures, weights=weights or [PACKAGED], out=out, options=options, threads=threads,
        confidence=confidence, draw=draw_detections if draw else None, masks=masks,
        elsewhere=[] if weights else [PACKAGED_FIELD],
    )  # fmt: skip
    counts = ", ".join(counted(int((found["kind"] == kind).sum()), kind) for kind in ("rock", "shadow"))
    typer.echo(f"precision {precision}, device {choose_device(device)}")
    typer.echo(f"{counts} in {out}")


def _by_option(reason: str) -> str:
    """Return the reason why a key of the prediction options is invalid, with the name of the option of `detect`."""
    return re.sub(r"\b(widths|gates|device)(?:_px)?\b(?:\.\d+)?", r"--\1", reason)


@command()
def ipd(
    labels_a: Annotated[
        Path,
        typer.Argument(help="Labels of the first domain: a folder of YOLO files, or a Parquet table."),
    ],
    predictions_a: Annotated[
        Path,
        typer.Argument(help="Detections in the first domain: YOLO files with confidence as sixth field, or a table."),
    ],
    labels_b: Annotated[Path, typer.Argument(help="Labels of the second domain, files with the same names.")],
    predictions_b: Annotated[Path, typer.Argument(help="Detections of the same detector in the second domain.")],
    confidence: Annotated[float, typer.Option(min=0, max=1, help="Confidence threshold of predictions.")] = 0.25,
    undetected: Annotated[
        Treatment, typer.Option(help="Labelled rock without overlapping prediction: IoU 0, or excluded.")
    ] = "zero",
    unpaired: Annotated[
        Treatment, typer.Option(help="Rock labelled in only one domain: IoU 0 in the other, or excluded.")
    ] = "left_out",
    missing: Annotated[
        Treatment, typer.Option(help="Labelled image without predictions: no detections, or excluded.")
    ] = "left_out",
    pair_iou: Annotated[
        float,
        typer.Option(min=0.01, max=1, help="Minimum IoU that pairs labels of the same rock when rock ids are missing."),
    ] = 0.5,
    unit: Annotated[
        Literal["view", "photo"] | None,
        typer.Option(help="Resampling unit of intervals; default: view if all names are photo keys, else photo."),
    ] = None,
    resamples: Annotated[int, typer.Option(min=100, help="Number of bootstrap replicates.")] = 1000,
    json: JsonFile = None,
) -> None:
    """Compute the instance performance difference (IPD) of a detector between two domains, with 95 % intervals.

    ipd: absolute value of the mean IoU difference, as in the paper; ipd_abs: mean of the absolute differences.
    """
    from polarsim.detect.external_sets import compare_sets
    from polarsim.formats.files import write_json

    report = compare_sets(
        (labels_a, labels_b),
        (predictions_a, predictions_b),
        confidence=confidence,
        undetected=undetected,
        unpaired=unpaired,
        missing=missing,
        unit=unit,
        pair_iou=pair_iou,
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
        values = [shown(row, key) for key in ("iou_mean_a", "iou_mean_b", "ipd", "ipd_abs")]
        rows.append([name, str(row["pairs"]), str(row["units"]), *values])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for cells in rows:
        typer.echo("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip())
    boxes = "; ".join(
        f"{name} A {row['labels_a']}, B {row['labels_b']}, pairs {row['pairs']}"
        for name, row in report["classes"].items()
    )
    typer.echo(
        "IOU_mean is over all ground truth boxes of a domain, ipd over the pairs of both domains, so ipd may "
        f"differ from the difference of the IOU_means: {boxes}"
    )
    for name in ("a", "b"):
        if unseen := report[f"without_predictions_{name}"]:
            some = ", ".join(unseen[:3]) + (", ..." if len(unseen) > 3 else "")
            how = "excluded (included with --missing zero)" if report["missing"] == "left_out" else "counted as IoU 0"
            typer.echo(f"{len(unseen)} labelled pictures have no predictions {name.upper()}, {how}: {some}")
    typer.echo(
        f"{report['pictures']} pictures; paired by {report['paired_by']}; confidence from {report['confidence']:g}; "
        f"undetected: {report['undetected']}; unpaired: {report['unpaired']}; intervals over {report['unit']}s"
    )

"""A detector to take away: trained on the rocks of all terrains, with its widths, its calibration and its card."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.cover_photos.scores import ALL
from polarsim.cover_photos.widths import Found, merged, read_folds, together, widths_for
from polarsim.detect import detectors
from polarsim.detect.calibration import Calibration, calibrated, calibration_error, fit_calibration
from polarsim.detect.grouping import labels_by_photo
from polarsim.detect.inference_widths import ClassSizes
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.formats.files import write_text
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.covers import COVER_SCORES, FINE_TUNED, ONE


@dataclass(frozen=True)
class Check:
    """How well confidences say how often a box is right, on photos that neither calibration nor detector has seen."""

    before: float  # expected calibration error
    after: float


def publish_detector(
    *,
    weights: Path,
    labels: Path,
    found: Mapping[str, Path],
    datasets: Mapping[str, Path],
    scores: Path,
    detector: Path,
    card: Path,
    options: PredictionOptions,
) -> None:
    """Write the detector with what was chosen for it, and its card in Markdown.

    Widths and calibration are chosen on the predictions of the folds' detectors for photos of terrains that they were
    not trained on, because the detector itself was trained on all rocks. The card shows the metrics of the folds.

    Parameters
    ----------
    weights : Path
        Detector that was trained on all terrains.
    found, datasets : mapping of fold to Path
        As in `widths.choose_widths`.
    scores : Path
        Table that `score_covers` wrote.

    Raises
    ------
    DetectError
        With fewer than two folds nothing can be left out.
    """
    if len(found) < 2:
        raise DetectError(f"{len(found)} fold: a detector's card needs figures of terrains left out of two or more")
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    seen = read_folds(found, datasets)
    trained = detectors.read_detector(weights)
    check = _check(truth, seen, trained.imgsz, options)
    sizes, calibration = _chosen(truth, together(seen), trained.imgsz, options)
    whole = replace(trained, sizes=tuple((own.widths, own.gates_px) for own in sizes.by_class), calibration=calibration)
    detectors.write_detector(detector, whole)
    figures = tables.read_parquet(scores, COVER_SCORES.columns)
    write_text(card, _card(whole, figures[figures["detectors"] == ONE], check))  # it is one detector itself


def _chosen(
    labels: pd.DataFrame, seen: Found, imgsz: int, options: PredictionOptions
) -> tuple[ClassSizes, Calibration]:
    sizes = widths_for(labels, seen, imgsz, options)
    boxes = [merged(rows, sizes, options.nms_iou) for rows in seen.values()]
    return sizes, fit_calibration(labels_by_photo(labels, list(seen)), boxes)


def _check(labels: pd.DataFrame, seen: Mapping[str, Found], imgsz: int, options: PredictionOptions) -> Check:
    """Calibrate each fold's boxes with widths and calibration of the other folds.

    Widths are chosen again: `widths.choose_widths` chose on boxes on the sand, while a published detector has no camera
    pose and keeps all boxes.
    """
    before: list[np.ndarray] = []
    after: list[np.ndarray] = []
    for fold, own in seen.items():
        sizes, calibration = _chosen(labels, together(seen, but=fold), imgsz, options)
        boxes = [merged(rows, sizes, options.nms_iou) for rows in own.values()]
        before += boxes
        after += [calibrated(rows, calibration) for rows in boxes]
    truth = labels_by_photo(labels, list(together(seen)))
    return Check(calibration_error(truth, before), calibration_error(truth, after))


def _card(detector: detectors.Detector, scores: pd.DataFrame, check: Check) -> str:
    whole = scores[scores["terrain"] == ALL]
    images, folds, seeds = int(whole["images"].iloc[0]), int(whole["folds"].iloc[0]), whole["seed"].nunique()
    rows = [
        f"| {row.terrain} | {row.kind} | {row.seed} | {row.labels} | {row.map50:.3f} | {_interval(row)} |"
        for row in scores.itertuples()
    ]
    worst = scores[(scores["terrain"] != ALL) & (scores["kind"] == BOX_CLASSES[0])].sort_values("map50").iloc[0]
    looked_at = "; ".join(
        f"{kind}s at {' and '.join(map(str, widths))} px of width"
        + (f", those below {gates[0]:g} px of 1,936 at the larger one" if gates else "")
        for kind, (widths, gates) in zip(BOX_CLASSES, detector.sizes, strict=True)
    )
    tuned = (scores["trained"] == FINE_TUNED).all()
    photos = (
        f"Then windows of the {images} published cover photos with the boxes that people drew; the detectors of the "
        "table have seen those of other terrains than the tested one."
        if tuned
        else "It has seen no photo."
    )
    return f"""# Detector of rocks and shadows on ground under low light

`polarsim detect PICTURES --out FOLDER` uses it where no other weights are named.

- **What it is**: {detectors.detector_name(detector.model)}, {_count(detector):,} numbers in half precision; boxes of
  classes {" and ".join(BOX_CLASSES)}; grey pictures of any size; {looked_at}.
- **Data**: rendered pictures{" first" if tuned else " alone"}: rocks that a generator carves, then scanned rocks of the
  POLAR-Sim release, strewn on made-up sand, cameras and lamps drawn at random. {photos}
- **Confidences** say how often a box is right (IoU 0.5): expected calibration error {check.after:.3f}, without
  calibration {check.before:.3f}, each fold's boxes calibrated by those of the other folds.
- **Where it fails**: rocks of terrain {worst.terrain} ({worst.map50:.2f}); rocks of less than about ten pixels of the
  looked-at picture, the dark sides of rocks in shade, piles that people label as one rock, cards and cloth behind the
  sand, the rims of craters.
- **Licence**: BSD-3-Clause, as the code; the release's meshes are CC0.

mAP@0.5 on {images} published cover photos, by {folds} detectors trained alike, each on terrains other than those that
it is tested on ({seeds} seed{"s" if seeds > 1 else ""}; 95 % intervals of a bootstrap over photos). The detector of
this card was trained on the rocks of all these terrains, so that it cannot be tested on them itself.

| terrain | labels | seed | count | mAP@0.5 | interval |
|---|---|---|---|---|---|
{chr(10).join(rows)}
"""


def _interval(row: object) -> str:
    low, high = row.map50_low, row.map50_high  # type: ignore[attr-defined]
    return "" if np.isnan(low) else f"[{low:.3f}, {high:.3f}]"


def _count(detector: detectors.Detector) -> int:
    return sum(value.numel() for value in detector.state.values())

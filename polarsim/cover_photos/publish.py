"""Published detector, trained on the rocks of all terrains, with inference widths, calibration and model card."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.cover_photos.scores import ALL
from polarsim.cover_photos.widths import WidthPredictions, read_folds, together, widths_for
from polarsim.detect import detectors
from polarsim.detect.calibration import Calibration, calibrate_boxes, calibration_error, fit_calibration
from polarsim.detect.grouping import labels_by_photo
from polarsim.detect.inference_widths import ClassInferenceWidths, merge, widths_text
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.formats.files import write_text
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.covers import COVER_SCORES, FINE_TUNED, SINGLE
from polarsim.wording import counted


def publish_detector(
    *,
    weights: Path,
    labels: Path,
    found: Mapping[str, Path],
    datasets: Mapping[str, Path],
    scores: Path,
    detector: Path,
    card: Path,
    width: int,
    options: PredictionOptions,
) -> None:
    """Write the detector with inference widths, calibration and a model card in Markdown.

    The detector was trained on all rocks. Therefore widths and calibration are selected on predictions of the detectors
    of the folds for photos of their test terrains, `found` and `datasets` as in `widths.choose_widths`. The card
    contains the metrics of the folds (`scores`). `width`: width of the photos, px.
    """
    if len(found) < 2:
        raise DetectError(f"{len(found)} fold, the model card requires metrics of at least 2 folds (covers.folds)")
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    by_fold = read_folds(found, datasets)
    trained = detectors.read_detector(weights)
    errors = _calibration_errors(truth, by_fold, trained.imgsz, options, width)
    sizes, calibration = _chosen(truth, together(by_fold), trained.imgsz, options, width)
    complete = replace(
        trained,
        sizes=tuple((of_class.widths, of_class.gates_px) for of_class in sizes.by_class),
        calibration=calibration,
    )
    detectors.write_detector(detector, complete)
    metrics = tables.read_parquet(scores, COVER_SCORES.columns)
    write_text(card, _card(complete, metrics[metrics["detectors"] == SINGLE], errors))


def _chosen(
    labels: pd.DataFrame, by_photo: WidthPredictions, imgsz: int, options: PredictionOptions, width: int
) -> tuple[ClassInferenceWidths, Calibration]:
    sizes = widths_for(labels, by_photo, imgsz, options, width)
    boxes = [merge(rows, sizes, options.nms_iou, width) for rows in by_photo.values()]
    return sizes, fit_calibration(labels_by_photo(labels, list(by_photo)), boxes)


def _calibration_errors(
    labels: pd.DataFrame,
    by_fold: Mapping[str, WidthPredictions],
    imgsz: int,
    options: PredictionOptions,
    width: int,
) -> tuple[float, float]:
    """Return the calibration error without and with calibration, for folds not used for widths and calibration.

    Widths are selected again without the sand filter of `widths.choose_widths`, because users of the published detector
    have no camera poses.
    """
    before: list[np.ndarray] = []
    after: list[np.ndarray] = []
    for fold, photos in by_fold.items():
        sizes, calibration = _chosen(labels, together(by_fold, but=fold), imgsz, options, width)
        boxes = [merge(rows, sizes, options.nms_iou, width) for rows in photos.values()]
        before += boxes
        after += [calibrate_boxes(rows, calibration) for rows in boxes]
    truth = labels_by_photo(labels, list(together(by_fold)))
    return calibration_error(truth, before), calibration_error(truth, after)


def _card(detector: detectors.Detector, scores: pd.DataFrame, errors: tuple[float, float]) -> str:
    overall = scores[scores["terrain"] == ALL]
    images, folds, seeds = int(overall["images"].iloc[0]), int(overall["folds"].iloc[0]), overall["seed"].nunique()
    rows = [
        f"| {row.terrain} | {row.kind} | {row.seed} | {row.labels} | {row.map50:.3f} | {_interval(row)} |"
        for row in scores.itertuples()
    ]
    worst = scores[(scores["terrain"] != ALL) & (scores["kind"] == BOX_CLASSES[0])].sort_values("map50").iloc[0]
    parameters = sum(value.numel() for value in detector.state.values())
    tuned = (scores["trained"] == FINE_TUNED).all()
    photos = (
        f"Fine-tuned on windows of the {images} published cover photos with human boxes; the detectors of the table "
        "were fine-tuned without photos of the test terrains."
        if tuned
        else "No photos."
    )
    return f"""# Detector of rocks and shadows on ground under low light

Default detector of `polarsim detect PICTURES --out FOLDER`.

- **Model**: {detectors.detector_name(detector.model)}, {parameters:,} parameters in half precision. Predicts
  boxes of the classes {" and ".join(BOX_CLASSES)} in grey images of any size. Inference widths:
  {widths_text(detector.sizes)}.
- **Training data**: rendered images: generated rocks, then scanned rocks of the POLAR-Sim release, on generated sand
  with random cameras and lamps. {photos}
- **Calibration**: expected calibration error {errors[1]:.3f} (IoU 0.5), without calibration {errors[0]:.3f}; the
  boxes of each fold were calibrated on the remaining folds. Valid for images like POLAR's: low lamps, deep shadows, no
  sky. `polarsim detect` warns of other images and marks them as not calibrated.
- **Limitations**: low accuracy for rocks of terrain {worst.terrain} ({worst.map50:.2f}), rocks smaller than about ten
  pixels of the input, dark sides of rocks in shadow, piles annotated as one rock, cards and cloth behind the sand, and
  rims of craters.
- **Licence**: BSD-3-Clause, as the code. The meshes of the release are CC0.

mAP@0.5 on {images} published cover photos, by {folds} detectors with equal training, each tested on terrains excluded
from its training ({counted(seeds, "seed")}; 95 % bootstrap intervals over photos). The published detector
was trained on the rocks of all these terrains and cannot be tested on them.

| terrain | labels | seed | count | mAP@0.5 | interval |
|---|---|---|---|---|---|
{chr(10).join(rows)}
"""


def _interval(row: object) -> str:
    low, high = row.map50_low, row.map50_high  # type: ignore[attr-defined]
    return "" if np.isnan(low) else f"[{low:.3f}, {high:.3f}]"

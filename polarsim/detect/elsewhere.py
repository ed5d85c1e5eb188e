"""Evaluation of a detector on images from outside POLAR with boxes or masks of rocks (`detect.elsewhere`)."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import ndimage

from polarsim.detect.calibration import calibration_error
from polarsim.detect.detect_pictures import Draw, detect_in_images
from polarsim.detect.metrics import Ranked, precision_at_recalls, rank
from polarsim.detect.options import PredictionOptions
from polarsim.errors import FormatError
from polarsim.formats import png, tables, yolo
from polarsim.formats.files import read_json
from polarsim.geometry.boxes import iou, match_by_iou
from polarsim.intervals import bootstrap_draws, percentile_interval
from polarsim.photo import ROCK
from polarsim.schemas.detect import ELSEWHERE

log = logging.getLogger("polarsim")

MIN_IOU = 0.5
MIN_CONFIDENCE, SHOWN_CONFIDENCE = 0.01, 0.25  # of average precision, and of recall and of drawn boxes
SIZES = {"small": (0.0, 0.025), "medium": (0.025, 0.1), "large": (0.1, np.inf)}  # longer side over image width
FALSE_PER_PICTURE = 0.5  # false positives per image at which `recall_at_half` is computed
MIN_MASK_AREA = 80  # px of a connected component of a mask
ROCK_CLASS = 0


def score_elsewhere(
    *,
    name: str,
    folder: Path,
    weights: Path,
    weights_elsewhere: Path,
    detections: Path,
    scores: Path,
    options: PredictionOptions,
    resamples: int,
    draw: Draw,
) -> None:
    """Detect rocks in the images of a folder; write the output of `polarsim detect` and a table, see `ELSEWHERE`.

    `weights` and `weights_elsewhere`: detectors of images like and unlike POLAR's.

    `folder` has `images/`, and `labels/NAME.txt` (YOLO, class 0 is rock) or `masks/NAME.png` (pixels above 0 are rock;
    each connected component of at least `MIN_MASK_AREA` px is a rock). Images without a label file are excluded.
    """

    def draw_shown(
        grey: np.ndarray, boxes: np.ndarray, masks: Mapping[str, np.ndarray] | None, title: str
    ) -> np.ndarray:
        return draw(grey, boxes[boxes[:, 4] >= SHOWN_CONFIDENCE], masks, title)

    labels = labelled_images(folder)
    found = detect_in_images(
        pictures=list(labels), weights=[weights], out=detections, options=options, threads=1,
        confidence=MIN_CONFIDENCE, draw=draw_shown, elsewhere=[weights_elsewhere],
    )  # fmt: skip
    # Unreadable images are not listed.
    images = {Path(row["file_name"]).name: row for row in read_json(detections / "coco.json")["images"]}
    read = {path.name: label for path, label in labels.items() if path.name in images}
    truth = [read_truth(label, (images[image]["width"], images[image]["height"])) for image, label in read.items()]
    rocks = found[found["kind"] == ROCK]
    predicted = [
        rocks.loc[rocks["picture"] == image, ["x0", "y0", "x1", "y1", "confidence"]].to_numpy(float) for image in read
    ]
    widths = np.array([images[image]["width"] for image in read], float)
    not_calibrated = 1 - np.mean([images[image]["calibrated"] for image in read])
    rows = score_rows(truth, predicted, widths, resamples)
    table = pd.DataFrame(rows).assign(name=name, not_calibrated=not_calibrated)
    tables.write_parquet(scores, tables.typed(table, ELSEWHERE))


def labelled_images(folder: Path) -> dict[Path, Path]:
    """Return the label or mask file of each labelled image of a folder, by image."""
    pictures = sorted(path for path in (folder / "images").glob("*") if path.suffix.lower() in png.SUFFIXES)
    if not pictures:
        raise FormatError(f"no image, expected {', '.join(png.SUFFIXES)}", path=folder / "images")
    candidates = {
        path: [folder / "labels" / f"{path.stem}.txt", folder / "masks" / f"{path.stem}.png"] for path in pictures
    }
    labelled = {
        path: next(label for label in labels if label.exists())
        for path, labels in candidates.items()
        if any(label.exists() for label in labels)
    }
    if not labelled:
        raise FormatError("no image has a file labels/NAME.txt or masks/NAME.png", path=folder)
    if unlabelled := [path.name for path in pictures if path not in labelled]:
        log.warning("%s: %d images without a label file excluded, such as %s", folder, len(unlabelled), unlabelled[0])
    return labelled


def read_truth(path: Path, size: tuple[int, int]) -> np.ndarray:
    """Return the boxes (n, 4) of the rocks of a label or mask file, px of the image with a size (width, height)."""
    if path.suffix == ".txt":
        classes, boxes = yolo.read_boxes(path, size=size)
        return boxes[classes == ROCK_CLASS]
    mask = png.read_png(path)
    mask = mask if mask.ndim == 2 else mask.max(axis=2)
    if mask.shape[::-1] != tuple(size):
        raise FormatError(f"{mask.shape[1]} x {mask.shape[0]} px, the image has {size[0]} x {size[1]}", path=path)
    return boxes_of_mask(mask > 0)


def boxes_of_mask(rock: np.ndarray) -> np.ndarray:
    """Return the boxes (n, 4) of the connected components of a mask (h, w) with at least `MIN_MASK_AREA` px."""
    parts, count = ndimage.label(rock, np.ones((3, 3)))
    area = np.bincount(parts.ravel(), minlength=count + 1)[1:]
    windows = [window for window, px in zip(ndimage.find_objects(parts), area, strict=True) if px >= MIN_MASK_AREA]
    return np.array([[x.start, y.start, x.stop, y.stop] for y, x in windows], float).reshape(-1, 4)


def score_rows(
    truth: Sequence[np.ndarray], predicted: Sequence[np.ndarray], widths: np.ndarray, resamples: int
) -> list[dict[str, object]]:
    """Return metrics of all rocks, and recall by size relative to the image width.

    `truth`: boxes (n, 4) of each image; `predicted`: boxes and confidences (m, 5); `widths` (p,): image widths, px.
    """
    ranked = rank(truth, predicted, np.array([MIN_IOU]))
    draws = bootstrap_draws(len(truth), resamples, 0, "elsewhere")
    replicates = np.array([precision_at_recalls(ranked, weights=weights).mean() for weights in draws])
    low, high = percentile_interval(replicates, len(truth))
    hit, false = _hits(truth, predicted, SHOWN_CONFIDENCE)
    hit_at_half, _ = _hits(truth, predicted, _half_confidence(ranked))
    of_class = [(np.zeros(len(boxes), int), boxes) for boxes in truth]
    with_class = [np.column_stack([boxes, np.zeros(len(boxes))]) for boxes in predicted]
    of_all = {
        "map50": float(precision_at_recalls(ranked).mean()), "map50_low": low, "map50_high": high,
        "false_per_image": false / len(truth), "calibration_error": calibration_error(of_class, with_class),
    }  # fmt: skip
    shares = [np.maximum(*(boxes[:, 2:] - boxes[:, :2]).T) / width for boxes, width in zip(truth, widths, strict=True)]
    size_share = np.concatenate(shares)
    rows = []
    for size, (least, most) in {"all": (0.0, np.inf), **SIZES}.items():
        chosen = (size_share >= least) & (size_share < most)
        rows.append({
            **(of_all if size == "all" else {}),
            "size": size, "images": len(truth), "labels": int(chosen.sum()),
            "recall": float(hit[chosen].mean()) if chosen.any() else np.nan,
            "recall_at_half": float(hit_at_half[chosen].mean()) if chosen.any() else np.nan,
        })  # fmt: skip
    return rows


def _hits(truth: Sequence[np.ndarray], predicted: Sequence[np.ndarray], confidence: float) -> tuple[np.ndarray, int]:
    """Return whether each label (n,) of all images has a confident prediction, and the number of other predictions."""
    hits, false = [], 0
    for boxes, rows in zip(truth, predicted, strict=True):
        confident = rows[rows[:, 4] >= confidence]
        matched, _ = match_by_iou(iou(boxes, confident[:, :4]), MIN_IOU)
        hits.append(np.isin(np.arange(len(boxes)), matched))
        false += len(confident) - len(matched)
    return np.concatenate(hits), false


def _half_confidence(ranked: Ranked) -> float:
    """Return the smallest confidence threshold with at most `FALSE_PER_PICTURE` false positives per image."""
    false = (ranked.counted[0, 0] & ~ranked.right[0, 0]).cumsum()
    allowed = false <= FALSE_PER_PICTURE * ranked.labels.shape[1]
    return float(ranked.confidence[allowed].min()) if allowed.any() else np.inf

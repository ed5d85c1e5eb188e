"""Inference widths for cover photos, selected by cross-validation over folds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import detectors
from polarsim.detect.dataset import dataset_images
from polarsim.detect.frame import read_picture
from polarsim.detect.grouping import BOX_COLUMNS, detection_rows, detections_by_photo, labels_by_photo
from polarsim.detect.inference_widths import ClassInferenceWidths, InferenceWidths, choose_sizes, merge
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import predict_images
from polarsim.detect.sand_filter import SandFilter
from polarsim.detect.split import TEST
from polarsim.errors import DetectError, with_path
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.covers import COVER_FOUND
from polarsim.schemas.detect import PREDICTIONS

WidthPredictions = dict[str, dict[int, np.ndarray]]  # photo -> width, px -> boxes (n, 6) of a detector


def predict_multiscale(
    *, weights: Path, dataset: Path, found: Path, widths: Sequence[int], options: PredictionOptions, threads: int
) -> None:
    """Write the predictions of a detector in the test photos of a data set at several inference widths, px.

    Raises
    ------
    PolarsimError
        Invalid weights, image or data set.
    """
    detector = detectors.read_detector(weights)
    with with_path(weights):
        loaded = detectors.load_detector(detector, found.parent, options, threads)
    rows = []
    for key in dataset_images(dataset, TEST):
        picture = read_picture(dataset / "images" / TEST / f"{key}.png")
        for width in sorted({detector.imgsz, *widths}):
            boxes = next(
                predict_images(loaded, [picture], ClassInferenceWidths.same(InferenceWidths((width,))), options.nms_iou)
            )
            rows += [(key, width, *row[1:]) for row in detection_rows(key, boxes)]
    table = pd.DataFrame(rows, columns=list(COVER_FOUND.columns)).astype(COVER_FOUND.dtypes)
    tables.write_parquet(found, table.round({"confidence": 5, **dict.fromkeys(BOX_COLUMNS, 2)}))


def choose_widths(
    *,
    labels: Path,
    found: Mapping[str, Path],
    datasets: Mapping[str, Path],
    predictions: Path,
    sizes: Path,
    imgsz: int,
    options: PredictionOptions,
    cameras: Sequence[Path] = (),
    meshes: Sequence[Path] = (),
) -> None:
    """Write one prediction table of all cover photos, and the widths and gates of each fold.

    The widths of a fold maximise AP@0.5 of rocks, and of shadows, on the test photos of the remaining folds, predicted
    by the detectors of these folds. Thus neither training nor selection uses the test terrain. With a single fold, the
    training width is used. Widths of the options override the selection.

    Parameters
    ----------
    found : mapping of fold to Path
        Tables of `predict_multiscale`.
    datasets : mapping of fold to Path
        Data sets of the folds, with the photos as test part.
    sizes : Path
        CSV to write: fold, kind, widths, gates_px (separated by spaces), width_of_training.
    imgsz : int
        Width of the training images, px.
    cameras, meshes : sequence of Path
        Folders of camera poses and meshes, one per terrain. Boxes outside the sand are dropped before the selection.
    """
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    sand = SandFilter.read(cameras, meshes)
    by_fold = {fold: kept_on_sand(boxes, sand) for fold, boxes in read_folds(found, datasets).items()}
    parts, rows = [], []
    for fold, boxes in by_fold.items():
        chosen = widths_for(truth, together(by_fold, but=fold), imgsz, options)
        parts.append(_table(boxes, chosen, options.nms_iou))
        rows += [
            (fold, kind, _joined(sizes_of_class.widths), _joined(sizes_of_class.gates_px), imgsz)
            for kind, sizes_of_class in zip(BOX_CLASSES, chosen.by_class, strict=True)
        ]
    table = pd.concat(parts, ignore_index=True).astype(PREDICTIONS.dtypes)
    tables.write_parquet(predictions, table[list(PREDICTIONS.columns)])
    tables.write_csv(sizes, pd.DataFrame(rows, columns=["fold", "kind", "widths", "gates_px", "width_of_training"]))


def widths_for(
    labels: pd.DataFrame, photos: WidthPredictions, imgsz: int, options: PredictionOptions
) -> ClassInferenceWidths:
    """Return the widths of the options, else the best widths on these photos, else the training width."""
    if named := ClassInferenceWidths.named(options):
        return named
    if not photos:
        return ClassInferenceWidths.same(InferenceWidths((imgsz,)))
    widths = sorted(next(iter(photos.values())))
    by_width = {width: [by_photo_width[width] for by_photo_width in photos.values()] for width in widths}
    return choose_sizes(labels_by_photo(labels, list(photos)), by_width, options.nms_iou, detectors.MAX_BOXES)


def read_folds(found: Mapping[str, Path], datasets: Mapping[str, Path]) -> dict[str, WidthPredictions]:
    """Read the predictions of each fold, see `read_found`."""
    return {fold: read_found(path, dataset_images(datasets[fold], TEST)) for fold, path in found.items()}


def kept_on_sand(found: WidthPredictions, sand: SandFilter) -> WidthPredictions:
    """Return the predictions on the sand."""
    return {key: {w: sand.keep(key, rows) for w, rows in by_width.items()} for key, by_width in found.items()}


def together(by_fold: Mapping[str, WidthPredictions], but: str = "") -> WidthPredictions:
    """Return the predictions of all folds except `but`."""
    return {key: by_width for fold, photos in by_fold.items() if fold != but for key, by_width in photos.items()}


def read_found(path: Path, keys: Sequence[str]) -> WidthPredictions:
    """Read the predictions of `predict_multiscale`, including photos without predictions."""
    table = tables.read_parquet(path, COVER_FOUND.columns)
    widths = sorted(table["width"].unique().tolist())
    if not widths:
        raise DetectError("no predictions in any cover photo at any inference width", path=path)
    by_width = {width: detections_by_photo(table[table["width"] == width], keys) for width in widths}
    return {key: {width: by_width[width][key] for width in widths} for key in keys}


def merge_widths(by_width: Mapping[int, np.ndarray], sizes: ClassInferenceWidths, nms_iou: float) -> np.ndarray:
    """Merge the boxes (n, 6) of a photo at the selected widths."""
    return merge(by_width, sizes, nms_iou, detectors.MAX_BOXES)


def _table(found: WidthPredictions, sizes: ClassInferenceWidths, nms_iou: float) -> pd.DataFrame:
    rows = [
        row for key, by_width in found.items() for row in detection_rows(key, merge_widths(by_width, sizes, nms_iou))
    ]
    return pd.DataFrame(rows, columns=list(PREDICTIONS.columns))


def _joined(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:g}" for number in numbers)

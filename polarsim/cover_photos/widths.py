"""Predictions in cover photos: inference widths selected by cross-validation over folds, fusion of training seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import detectors
from polarsim.detect.dataset import dataset_images
from polarsim.detect.frame import read_picture
from polarsim.detect.fusion import fuse
from polarsim.detect.grouping import BOX_COLUMNS, detection_rows, detections_by_photo, labels_by_photo
from polarsim.detect.inference_widths import ClassInferenceWidths, InferenceWidths, choose_sizes, merge
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import predict_images, prediction_table
from polarsim.detect.sand_filter import SandFilter
from polarsim.detect.split import TEST
from polarsim.errors import DetectError, with_path
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.covers import COVER_FOUND
from polarsim.schemas.detect import PREDICTIONS
from polarsim.site import Site

WidthPredictions = dict[str, dict[int, np.ndarray]]  # photo -> width, px -> boxes (n, 6) of a detector


def predict_multiscale(
    *,
    weights: Path,
    dataset: Path,
    found: Path,
    size: tuple[int, int],
    widths: Sequence[int],
    options: PredictionOptions,
    threads: int,
) -> None:
    """Write the predictions of a detector in the test photos of a data set at several inference widths, px.

    Boxes are in pixels of photos of a size (width, height).
    """
    detector = detectors.read_detector(weights)
    with with_path(weights):
        loaded = detectors.load_detector(detector, found.parent, options, threads)
    rows = []
    for key in dataset_images(dataset, TEST):
        picture = read_picture(dataset / "images" / TEST / f"{key}.png")
        for width in sorted({detector.imgsz, *widths}):
            single = ClassInferenceWidths.same(InferenceWidths((width,)))
            boxes = next(predict_images(loaded, [picture], single, options.nms_iou, size))
            rows += [(key, width, *row[1:]) for row in detection_rows(key, boxes)]
    table = tables.typed(rows, COVER_FOUND)
    tables.write_parquet(found, table.round({"confidence": 5, **dict.fromkeys(BOX_COLUMNS, 2)}))


def choose_widths(
    *,
    labels: Path,
    found: Mapping[str, Path],
    datasets: Mapping[str, Path],
    predictions: Path,
    sizes: Path,
    site: Site,
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
    found, datasets : mapping of fold to Path
        Tables of `predict_multiscale`, and data sets with the photos as test part.
    sizes : Path
        CSV to write: fold, kind, widths, gates_px (separated by spaces), width_of_training.
    imgsz : int
        Width of the training images, px.
    cameras, meshes : sequence of Path
        Folders of camera poses and meshes, one per terrain. Boxes outside the sand are dropped before the selection.
    """
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    by_fold = read_folds(found, datasets, SandFilter.read(site, cameras, meshes))
    found_rows, rows = [], []
    for fold, boxes in by_fold.items():
        chosen = widths_for(truth, together(by_fold, but=fold), imgsz, options, site.images.width)
        for key, by_width in boxes.items():
            found_rows += detection_rows(key, merge(by_width, chosen, options.nms_iou, site.images.width))
        rows += [
            (fold, kind, _joined(sizes_of_class.widths), _joined(sizes_of_class.gates_px), imgsz)
            for kind, sizes_of_class in zip(BOX_CLASSES, chosen.by_class, strict=True)
        ]
    table = tables.typed(found_rows, PREDICTIONS)
    tables.write_parquet(predictions, table)
    tables.write_csv(sizes, pd.DataFrame(rows, columns=["fold", "kind", "widths", "gates_px", "width_of_training"]))


def widths_for(
    labels: pd.DataFrame, photos: WidthPredictions, imgsz: int, options: PredictionOptions, width: int
) -> ClassInferenceWidths:
    """Return the widths of the options, else the best on these photos of a `width`, px, else the training width."""
    if named := ClassInferenceWidths.named(options):
        return named
    if not photos:
        return ClassInferenceWidths.same(InferenceWidths((imgsz,)))
    widths = sorted(next(iter(photos.values())))
    by_width = {width: [by_photo_width[width] for by_photo_width in photos.values()] for width in widths}
    return choose_sizes(labels_by_photo(labels, list(photos)), by_width, options.nms_iou, width)


def read_folds(
    found: Mapping[str, Path], datasets: Mapping[str, Path], sand: SandFilter | None = None
) -> dict[str, WidthPredictions]:
    """Read the predictions of each fold on the sand, see `read_found`."""
    by_fold = {fold: read_found(path, dataset_images(datasets[fold], TEST)) for fold, path in found.items()}
    if sand:
        for photos in by_fold.values():
            for key, by_width in photos.items():
                photos[key] = {width: sand.keep(key, rows) for width, rows in by_width.items()}
    return by_fold


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


def merge_seeds(*, predictions: Sequence[Path], merged: Path, options: PredictionOptions) -> None:
    """Merge prediction tables of several training seeds on the same photos, see `fusion.fuse`."""
    parts = [tables.read_parquet(path, PREDICTIONS.columns) for path in predictions]
    keys = sorted(set().union(*(table["key"] for table in parts)))
    boxes = [detections_by_photo(table, keys) for table in parts]
    fused = {key: fuse([of_seed[key] for of_seed in boxes], options.nms_iou) for key in keys}
    tables.write_parquet(merged, prediction_table([row for key in keys for row in detection_rows(key, fused[key])]))


def _joined(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:g}" for number in numbers)

"""Inference widths for cover photos, chosen on the photos of the other folds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import detectors
from polarsim.detect.dataset import read_pictures
from polarsim.detect.frame import read_picture
from polarsim.detect.grouping import BOX_COLUMNS, detection_rows, detections_by_photo, labels_by_photo
from polarsim.detect.inference_widths import ClassSizes, Sizes, choose_sizes, merge
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import detect
from polarsim.detect.sand_filter import Sand
from polarsim.detect.split import TEST
from polarsim.errors import DetectError, about
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.covers import COVER_FOUND
from polarsim.schemas.detect import PREDICTIONS

Found = dict[str, dict[int, np.ndarray]]  # photo -> width, px -> boxes (n, 6) as detectors give them


def predict_multiscale(
    *, weights: Path, dataset: Path, found: Path, widths: Sequence[int], options: PredictionOptions, threads: int
) -> None:
    """Write what a detector finds in the cover photos of a data set's test part, at each of some widths, px.

    Raises
    ------
    PolarsimError
        Weights that are no detector, a broken picture or data set.
    """
    detector = detectors.read_detector(weights)
    with about(weights):
        loaded = detectors.load_detector(detector, found.parent, options, threads)
    rows = []
    for key in read_pictures(dataset, TEST):
        picture = read_picture(dataset / "images" / TEST / f"{key}.png")
        for width in sorted({detector.imgsz, *widths}):
            boxes = next(detect(loaded, [picture], ClassSizes.same(Sizes((width,))), options.nms_iou))
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
    """Write one prediction table of all cover photos, and the widths and gates of every fold.

    A fold's widths are those with the largest AP@0.5 of rocks, and of shadows, on the photos of all other folds, as
    predicted by their own detectors: neither detector nor choice has used the terrain. With one fold the width is that
    of the training. Widths that the options name are taken as they are.

    Parameters
    ----------
    found : mapping of fold to Path
        Tables of `predict_multiscale`.
    datasets : mapping of fold to Path
        Data sets of the folds, whose test parts name the photos.
    sizes : Path
        CSV to write: fold, kind, widths, gates_px (spaces between numbers), width_of_training.
    imgsz : int
        Width of the training's pictures, px.
    cameras, meshes : sequence of Path
        Folders of poses, and of meshes, one a terrain: boxes off the sand are left out there, before widths are chosen.
    """
    truth = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    sand = Sand.read(cameras, meshes)
    seen = {fold: kept_on_sand(own, sand) for fold, own in read_folds(found, datasets).items()}
    parts, rows = [], []
    for fold, own in seen.items():
        chosen = widths_for(truth, together(seen, but=fold), imgsz, options)
        parts.append(_table(own, chosen, options.nms_iou))
        rows += [
            (fold, kind, _joined(sizes_of_class.widths), _joined(sizes_of_class.gates_px), imgsz)
            for kind, sizes_of_class in zip(BOX_CLASSES, chosen.by_class, strict=True)
        ]
    table = pd.concat(parts, ignore_index=True).astype(PREDICTIONS.dtypes)
    tables.write_parquet(predictions, table[list(PREDICTIONS.columns)])
    tables.write_csv(sizes, pd.DataFrame(rows, columns=["fold", "kind", "widths", "gates_px", "width_of_training"]))


def widths_for(labels: pd.DataFrame, others: Found, imgsz: int, options: PredictionOptions) -> ClassSizes:
    """Return the widths that the options name, else the best on these photos, else that of the training."""
    if named := ClassSizes.named(options):
        return named
    if not others:
        return ClassSizes.same(Sizes((imgsz,)))
    widths = sorted(next(iter(others.values())))
    by_width = {width: [found[width] for found in others.values()] for width in widths}
    return choose_sizes(labels_by_photo(labels, list(others)), by_width, options.nms_iou, detectors.MAX_BOXES)


def read_folds(found: Mapping[str, Path], datasets: Mapping[str, Path]) -> dict[str, Found]:
    """What every fold's detector found, see `read_found`."""
    return {fold: read_found(path, read_pictures(datasets[fold], TEST)) for fold, path in found.items()}


def kept_on_sand(found: Found, sand: Sand) -> Found:
    """What stands on the sand of what was found."""
    return {key: {w: sand.keep(key, rows) for w, rows in by_width.items()} for key, by_width in found.items()}


def together(seen: Mapping[str, Found], but: str = "") -> Found:
    """What was found in the photos of all folds but one."""
    return {key: by_width for fold, own in seen.items() if fold != but for key, by_width in own.items()}


def read_found(path: Path, keys: Sequence[str]) -> Found:
    """What `predict_multiscale` wrote of these photos; those in which nothing was found too."""
    table = tables.read_parquet(path, COVER_FOUND.columns)
    widths = sorted(table["width"].unique().tolist())
    if not widths:
        raise DetectError("the detector found nothing in any cover photo at any width", path=path)
    by_width = {width: detections_by_photo(table[table["width"] == width], keys) for width in widths}
    return {key: {width: by_width[width][key] for width in widths} for key in keys}


def merged(by_width: Mapping[int, np.ndarray], sizes: ClassSizes, nms_iou: float) -> np.ndarray:
    """Boxes (n, 6) of one photo at the chosen widths."""
    return merge(by_width, sizes, nms_iou, detectors.MAX_BOXES)


def _table(found: Found, sizes: ClassSizes, nms_iou: float) -> pd.DataFrame:
    rows = [row for key, by_width in found.items() for row in detection_rows(key, merged(by_width, sizes, nms_iou))]
    return pd.DataFrame(rows, columns=list(PREDICTIONS.columns))


def _joined(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:g}" for number in numbers)

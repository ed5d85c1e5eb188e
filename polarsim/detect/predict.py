"""Predictions of a detector on the test images of a domain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect import detectors
from polarsim.detect.dataset import dataset_images
from polarsim.detect.frame import letterbox, read_picture
from polarsim.detect.grouping import BOX_COLUMNS, detection_rows
from polarsim.detect.inference_widths import ClassInferenceWidths, InferenceWidths, merge
from polarsim.detect.options import PredictionOptions
from polarsim.detect.sand_filter import SandFilter
from polarsim.detect.split import TEST
from polarsim.digest import code_digest
from polarsim.errors import DetectError, with_path
from polarsim.formats.table_parts import write_in_parts
from polarsim.formats.tables import typed
from polarsim.geometry import boxes
from polarsim.provenance import digest
from polarsim.schemas.detect import PREDICTIONS
from polarsim.site import Site

PREDICTION_COLUMNS = PREDICTIONS.columns
BATCH = 4  # number of images in a call; features of more images do not stay in the cache of a processor
PART = 50 * BATCH  # number of images with predictions in memory


def predict_domains(
    *,
    weights: Path,
    datasets: Sequence[Path],
    predictions: Sequence[Path],
    site: Site,
    options: PredictionOptions,
    threads: int,
    cameras: Sequence[Path] = (),
    meshes: Sequence[Path] = (),
) -> None:
    """Apply `predict` to the test part of each data set."""
    of_dataset = partial(
        predict, weights=weights, site=site, options=options, threads=threads, cameras=cameras, meshes=meshes
    )
    for dataset, table in zip(datasets, predictions, strict=True):
        of_dataset(dataset=dataset, predictions=table)


def predict(
    *,
    weights: Path,
    dataset: Path,
    predictions: Path,
    site: Site,
    options: PredictionOptions,
    threads: int,
    cameras: Sequence[Path] = (),
    meshes: Sequence[Path] = (),
) -> None:
    """Write the predictions of a detector on the test part of a data set, boxes in pixels of the full photo.

    Memory does not grow with the number of images. An interrupted call resumes. Boxes outside the sand are dropped on
    terrains with folders of camera poses and meshes.
    """
    detector = detectors.read_detector(weights)
    sizes = inference_widths_of(detector, options)
    keys = dataset_images(dataset, TEST)
    predictions.parent.mkdir(parents=True, exist_ok=True)
    with with_path(weights):
        loaded = detectors.load_detector(detector, predictions.parent, options, threads)
    paths = {key: dataset / "images" / TEST / f"{key}.png" for key in keys}
    sand = SandFilter.read(site, cameras, meshes)

    def see(some: Sequence[str]) -> pd.DataFrame:
        rows: list[tuple[Any, ...]] = []
        for group in (some[n : n + BATCH] for n in range(0, len(some), BATCH)):
            pictures = [read_picture(paths[key]) for key in group]
            results = predict_images(loaded, pictures, sizes, options.nms_iou, site.images.size)
            rows += [
                row
                for key, result in zip(group, results, strict=True)
                for row in detection_rows(key, sand.keep(key, result))
            ]
        return prediction_table(rows)

    identity = digest([weights, *paths.values(), *sand.files], code_digest(__name__), options.model_dump_json())
    write_in_parts(predictions, keys, see, PART, identity)


def inference_widths_of(detector: detectors.Detector, options: PredictionOptions) -> ClassInferenceWidths:
    """Return the inference widths of the options, else the widths stored in the detector, else the training width."""
    if named := ClassInferenceWidths.named(options):
        return named
    if detector.sizes:
        return ClassInferenceWidths(
            tuple(InferenceWidths(tuple(widths), tuple(gates)) for widths, gates in detector.sizes)
        )
    return ClassInferenceWidths.same(InferenceWidths((detector.imgsz,)))


def predict_images(
    loaded: detectors.LoadedDetector,
    pictures: list[np.ndarray],
    sizes: ClassInferenceWidths,
    nms_iou: float,
    full: tuple[int, int],
) -> Iterator[np.ndarray]:
    """Yield the boxes (n, 6) x0, y0, x1, y1, confidence, class of each image (h, w) uint8; images have equal sizes.

    Boxes are in pixels of the original image of size `full` (width, height).
    """
    if len({picture.shape for picture in pictures}) > 1:
        raise DetectError(f"images of sizes {sorted({picture.shape for picture in pictures})}, expected equal sizes")
    widths = sizes.widths
    by_width = [_detect_at(loaded, pictures, width, full) for width in widths]
    for results in zip(*by_width, strict=True):
        yield merge(dict(zip(widths, results, strict=True)), sizes, nms_iou, full[0])


def _detect_at(
    loaded: detectors.LoadedDetector, pictures: list[np.ndarray], width: int, full: tuple[int, int]
) -> list[np.ndarray]:
    framed = [letterbox(picture, width, full) for picture in pictures]
    kept = []
    for rows, (_, offset, scale) in zip(loaded(np.stack([pixels for pixels, _, _ in framed])), framed, strict=True):
        rows[:, :4] = boxes.clip((rows[:, :4] - np.tile(offset, 2)) * np.tile(scale, 2), *full)
        kept.append(rows[boxes.area(rows[:, :4]) > 0])
    return kept


def prediction_table(rows: Sequence[tuple[Any, ...]]) -> pd.DataFrame:
    """Return rows of `PREDICTION_COLUMNS` as a rounded table, sorted by photo, kind and descending confidence."""
    table = typed(rows, PREDICTIONS)
    table = table.round({"confidence": 5, **dict.fromkeys(BOX_COLUMNS, 2)})
    order = [True, True, False, *[True] * 4]
    return table.sort_values(list(PREDICTION_COLUMNS), ascending=order, kind="stable", ignore_index=True)

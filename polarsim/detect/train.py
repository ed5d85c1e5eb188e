"""Training of one detector on one domain's data set."""

from __future__ import annotations

import shutil
from pathlib import Path

from polarsim.detect import detectors
from polarsim.detect.dataset import KINDS, MASKS, read_pictures
from polarsim.detect.options import PredictionOptions, TrainingOptions
from polarsim.detect.split import TRAIN, VAL
from polarsim.digest import code_digest
from polarsim.errors import DetectError, PolarsimError
from polarsim.formats import tables
from polarsim.formats.table_parts import reuse_folder
from polarsim.provenance import digest


def train_detector(
    *,
    dataset: Path,
    weights: Path,
    curve: Path,
    options: TrainingOptions,
    prediction: PredictionOptions,
    imgsz: int,
    seed: int,
    threads: int,
    work: Path,
    start: Path | None = None,
) -> None:
    """Train on a data set and keep the weights of the best validation, as the paper does.

    Parameters
    ----------
    dataset : Path
        Folder that `make_dataset` wrote; nothing is written into it.
    weights : Path
        Detector to write, see `detectors.write_detector`.
    curve : Path
        CSV to write, a row an epoch: losses, and mAP on the val part.
    prediction : PredictionOptions
        How validation looks at pictures: as the test will.
    imgsz : int
        Longer side of the pictures, px.
    threads : int
        Threads of torch on a CPU. Weights are the same bytes only for the same number of threads.
    work : Path
        Folder for checkpoints. A training that was stopped goes on from there when nothing that decides it has changed.
    start : Path, optional
        Detector of the same model to start from, in place of the options' pretrained weights.

    Raises
    ------
    PolarsimError
        A broken data set, one without labels or masks to train on, or a disk that is full.
    """
    if not any(path.stat().st_size for path in (dataset / "labels" / TRAIN).glob("*.txt")):
        raise DetectError("not one labelled box in its train part", path=dataset)
    if start:
        options = options.model_copy(update={"pretrained": start})
    if options.masks:
        _check_masks(dataset)
    if options.start_weights and not options.start_weights.is_file():
        raise DetectError("the pretrained weights are missing", path=options.start_weights)
    try:
        training = detectors.Training(dataset, work / "training", options, prediction, imgsz, seed, threads)
        _prepare(training)
        trained = detectors.family(options.model).train(training)
        tables.write_csv(curve, trained.curve)
        detectors.write_detector(
            weights, detectors.Detector(options.model, imgsz, options.epochs, options.start, trained.state)
        )
        shutil.rmtree(training.folder, ignore_errors=True)
    except OSError as error:
        raise PolarsimError(f"training cannot go on, {error.strerror or error}", path=work) from error


def _check_masks(dataset: Path) -> None:
    for part in (TRAIN, VAL):
        for key in read_pictures(dataset, part):
            if not (dataset / MASKS / part / f"{key}.png").is_file():
                raise DetectError(f"detect.training.masks: {part} picture {key} has no mask", path=dataset)


def _prepare(training: detectors.Training) -> None:
    """Empty the folder of a training unless it holds the same one."""
    files = (
        training.dataset / kind / part / f"{key}{ending}"
        for part in (TRAIN, VAL)
        for key in read_pictures(training.dataset, part)
        for kind, ending in (*KINDS, *([(MASKS, ".png")] if training.options.masks else []))
    )
    start = training.options.start_weights
    options = (training.options.model_dump_json(), training.prediction.model_dump_json())
    words = (code_digest(__name__), *options, str(training.imgsz), str(training.seed), digest([start] if start else []))
    reuse_folder(training.folder, digest(files, *words))

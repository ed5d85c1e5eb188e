"""Training of one detector on the data set of one domain."""

from __future__ import annotations

import shutil
from pathlib import Path

from polarsim.detect import detectors
from polarsim.detect.dataset import KINDS, MASKS, dataset_images
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
    """Train on a data set and write the weights of the best validation, as in the paper.

    Parameters
    ----------
    weights : Path
        Detector to write, see `detectors.write_detector`.
    curve : Path
        CSV to write, a row per epoch: losses, and mAP on the validation part.
    prediction : PredictionOptions
        Inference options of validation, equal to those of the test.
    threads : int
        Number of torch threads on a CPU. Weights are bit-equal only for equal numbers of threads.
    work : Path
        Folder for checkpoints. An interrupted training resumes if data and options are unchanged.
    start : Path, optional
        Detector of the same model with the initial weights; overrides the pretrained weights of the options.
    """
    if not any(path.stat().st_size for path in (dataset / "labels" / TRAIN).glob("*.txt")):
        raise DetectError("no labelled box in the train part", path=dataset)
    if start:
        options = options.model_copy(update={"pretrained": start})
    for part in (TRAIN, VAL) if options.masks else ():
        for key in dataset_images(dataset, part):
            if not (dataset / MASKS / part / f"{key}.png").is_file():
                raise DetectError(f"detect.training.masks: {part} image {key} has no mask", path=dataset)
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
        raise PolarsimError(f"training failed, {error.strerror or error}", path=work) from error


def _prepare(training: detectors.Training) -> None:
    """Empty the training folder unless it contains a checkpoint of the same training."""
    files = (
        training.dataset / kind / part / f"{key}{ending}"
        for part in (TRAIN, VAL)
        for key in dataset_images(training.dataset, part)
        for kind, ending in (*KINDS, *([(MASKS, ".png")] if training.options.masks else []))
    )
    start = training.options.start_weights
    options = (training.options.model_dump_json(), training.prediction.model_dump_json())
    words = (code_digest(__name__), *options, str(training.imgsz), str(training.seed), digest([start] if start else []))
    reuse_folder(training.folder, digest(files, *words))

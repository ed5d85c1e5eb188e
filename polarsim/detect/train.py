"""Training of one judge on one domain's data set."""

from __future__ import annotations

import shutil
from pathlib import Path

from polarsim.detect import judges
from polarsim.detect.dataset import read_pictures
from polarsim.detect.judges.download import ensure_weights
from polarsim.detect.options import DetectOptions
from polarsim.detect.parts import digest
from polarsim.detect.split import TRAIN, VAL
from polarsim.digest import code_digest
from polarsim.errors import DetectError, PolarsimError
from polarsim.formats import tables
from polarsim.formats.files import read_json, write_json


def train_judge(*, dataset: Path, weights: Path, curve: Path, options: DetectOptions, threads: int, work: Path) -> None:
    """Train on a data set and keep the weights of the best validation, as the paper does.

    Parameters
    ----------
    dataset : Path
        Folder that `make_dataset` wrote; nothing is written into it.
    weights : Path
        Judge to write, see `judges.write_judge`.
    curve : Path
        CSV to write, a row an epoch: losses, and mAP on the val part.
    threads : int
        Threads of torch on a CPU. Weights are the same bytes only for the same number of threads.
    work : Path
        Folder for checkpoints. A training that was stopped goes on from there when nothing that decides it has changed.

    Raises
    ------
    PolarsimError
        A broken data set, one without labels to train on, or a disk that is full.
    """
    if not any(path.stat().st_size for path in (dataset / "labels" / TRAIN).glob("*.txt")):
        raise DetectError("not one labelled box in its train part", path=dataset)
    ensure_weights(options)
    try:
        folder = _prepare(dataset, options, work)
        training = judges.Training(dataset, folder, options, threads)
        trained = judges.family(options.model).train(training)
        start = options.pretrained.name if options.pretrained else "scratch"
        tables.write_csv(curve, trained.curve)
        judges.write_judge(weights, judges.Judge(options.model, options.imgsz, options.epochs, start, trained.state))
        shutil.rmtree(folder, ignore_errors=True)
    except OSError as error:
        raise PolarsimError(f"training cannot go on, {error.strerror or error}", path=work) from error


def _prepare(dataset: Path, options: DetectOptions, work: Path) -> Path:
    """The folder of this training, emptied unless it holds the same one."""
    files = (
        dataset / kind / part / f"{key}.{suffix}"
        for part in (TRAIN, VAL)
        for key in read_pictures(dataset, part)
        for kind, suffix in (("images", "png"), ("labels", "txt"))
    )
    code = code_digest(__name__)
    identity = {"code": code, "options": options.model_dump(mode="json"), "dataset": digest(files)}
    folder = work / "training"
    if not (folder / "identity.json").is_file() or read_json(folder / "identity.json") != identity:
        shutil.rmtree(folder, ignore_errors=True)
    write_json(folder / "identity.json", identity)
    return folder

"""Training of one judge on one domain's data set."""

from __future__ import annotations

import hashlib
import logging
import math
import shutil
from copy import copy
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.detect import judges
from polarsim.detect.dataset import read_pictures
from polarsim.detect.options import DetectOptions
from polarsim.detect.split import TRAIN, VAL
from polarsim.errors import DetectError, PolarsimError, about
from polarsim.formats import tables
from polarsim.formats.files import read_json, write_json, write_text
from polarsim.photo import BOX_CLASSES

CURVE_COLUMNS = {  # of Ultralytics' results.csv -> ours
    "epoch": "epoch",
    "train/box_loss": "train_box_loss",
    "train/cls_loss": "train_class_loss",
    "train/dfl_loss": "train_edge_loss",
    "val/box_loss": "val_box_loss",
    "val/cls_loss": "val_class_loss",
    "val/dfl_loss": "val_edge_loss",
    "metrics/precision(B)": "val_precision",
    "metrics/recall(B)": "val_recall",
    "metrics/mAP50(B)": "val_map50",
    "metrics/mAP50-95(B)": "val_map50_95",
}
log = logging.getLogger("polarsim")


def train_judge(*, dataset: Path, weights: Path, curve: Path, options: DetectOptions, threads: int, work: Path) -> None:
    """Train on a data set and keep the weights of the best validation, as the paper does.

    Parameters
    ----------
    dataset : Path
        Folder that `make_dataset` wrote; nothing is written into it.
    weights : Path
        Judge to write, see `judges.write_judge`.
    curve : Path
        CSV to write, a row an epoch: losses, and precision, recall and mAP on the val part.
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
        raise DetectError(f"{dataset}: not one labelled box in its train part")
    try:
        run = _prepare(dataset, options, work)
        trainer = _fit(run, options, threads)
        state = judges.ultralytics(work).load_checkpoint(str(trainer.best))[0].state_dict()
        start = options.pretrained.name if options.pretrained else "scratch"
        judge = judges.Judge(
            options.model, options.imgsz, options.epochs, start, {name: value.half() for name, value in state.items()}
        )
        tables.write_csv(curve, _read_curve(Path(trainer.csv)))
        judges.write_judge(weights, judge)
        shutil.rmtree(run, ignore_errors=True)
    except OSError as error:
        raise PolarsimError(f"{work}: training cannot go on, {error.strerror or error}") from error


def _prepare(dataset: Path, options: DetectOptions, work: Path) -> Path:
    """The folder of this training, emptied unless it holds the same one: lists of pictures, links to the data set.

    Ultralytics puts caches beside the labels that it reads and follows no link when it names them, so it gets links to
    the data set's folders in a place of its own.
    """
    identity = {"options": options.model_dump(mode="json"), "dataset": _digest(dataset)}
    run = work / "training"
    if not (run / "identity.json").is_file() or read_json(run / "identity.json") != identity:
        shutil.rmtree(run, ignore_errors=True)
    for part in (TRAIN, VAL):
        for kind in ("images", "labels"):
            (run / kind).mkdir(parents=True, exist_ok=True)
            link = run / kind / part
            link.unlink(missing_ok=True)
            link.symlink_to((dataset / kind / part).resolve(), target_is_directory=True)
        write_text(run / f"{part}.txt", "".join(f"./images/{part}/{key}.png\n" for key in read_pictures(dataset, part)))
    names = "".join(f"  {number}: {name}\n" for number, name in enumerate(BOX_CLASSES))
    write_text(run / "data.yaml", f"path: {run.resolve()}\ntrain: {TRAIN}.txt\nval: {VAL}.txt\nnames:\n{names}")
    write_json(run / "identity.json", identity)
    return run


def _digest(dataset: Path) -> str:
    """Of the names and contents of all that a judge is trained on."""
    digest = hashlib.sha256()
    for part in (TRAIN, VAL):
        for key in read_pictures(dataset, part):
            for path in (dataset / "images" / part / f"{key}.png", dataset / "labels" / part / f"{key}.txt"):
                digest.update(f"{path.name}\n".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def _fit(run: Path, options: DetectOptions, threads: int) -> Any:
    """Ultralytics' trainer after its work, new or gone on with."""
    library = judges.ultralytics(run.parent)
    last = run / "out" / "weights" / "last.pt"
    arguments = _arguments(run, options)
    if _unfinished(last, library):
        log.info("going on with the training in %s", run)
        arguments |= {"model": str(last), "resume": str(last)}
    start = None
    if options.pretrained:
        start = judges.load_start(options.pretrained, options.model, run.parent)

    class Validator(library.DetectionValidator):  # type: ignore[name-defined, misc]
        def postprocess(self, preds: Any) -> list[dict[str, Any]]:
            found = library.non_max_suppression(preds, self.args.conf, self.args.iou, max_det=self.args.max_det)
            return [{"bboxes": x[:, :4], "conf": x[:, 4], "cls": x[:, 5], "extra": x[:, 6:]} for x in found]

    class Trainer(library.DetectionTrainer):  # type: ignore[name-defined, misc]
        def get_model(self, cfg: Any = None, weights: Any = None, verbose: bool = False) -> Any:
            return super().get_model(cfg, weights or start, verbose)

        def build_optimizer(self, *args: Any, **kwargs: Any) -> Any:
            optimizer = super().build_optimizer(*args, **kwargs)
            for group in optimizer.param_groups:
                group["fused"] = True  # Ultralytics asks for one kernel instead of hundreds on GPUs only
            return optimizer

        def get_validator(self) -> Any:
            return Validator(self.test_loader, save_dir=self.save_dir, args=copy(self.args), _callbacks=self.callbacks)

    trainer = Trainer(overrides=arguments)
    trainer.add_callback("on_train_start", lambda t: _set_up_torch(t, threads))
    trainer.add_callback("on_fit_epoch_end", _report)
    with about(run):
        trainer.train()
        if not trainer.best.is_file() or not math.isfinite(float(sum(trainer.tloss.values()))):
            raise DetectError("training diverged: lower detect.learning_rate")
    return trainer


def _unfinished(checkpoint: Path, library: Any) -> bool:
    """Whether a training can go on from a checkpoint: it is whole, and not the last one."""
    try:
        return bool(checkpoint.is_file() and library.load_checkpoint(str(checkpoint))[1]["epoch"] >= 0)
    except Exception:  # cut in the middle of writing: torch raises many kinds
        return False


def _arguments(run: Path, options: DetectOptions) -> dict[str, Any]:
    """Every argument that is not Ultralytics' default, and why."""
    augment = options.augment
    return {
        "model": f"{options.model}.yaml",
        "data": str(run / "data.yaml"),
        "project": str(run.resolve()),
        "name": "out",
        "exist_ok": True,
        "epochs": options.epochs,
        "patience": options.epochs,  # no early stop: judges of a table are trained alike
        "imgsz": options.imgsz,
        "batch": options.batch,
        "nbs": options.batch,  # a step a batch; else gradients of 64 pictures are gathered before each step
        "optimizer": "AdamW",  # "auto" would overrule lr0
        "lr0": options.learning_rate,
        "lrf": 0.05,
        "cos_lr": True,
        "warmup_epochs": min(1.0, options.epochs / 10),
        "warmup_bias_lr": 0.0,
        "device": "0" if judges.choose_device(options.device) == "cuda" else "cpu",
        "iou": options.nms_iou,  # of validation, as in prediction
        "max_det": options.max_boxes,
        "seed": options.seed,
        "deterministic": True,
        "pretrained": False,  # or it would download; `Trainer.get_model` loads the weights that options name
        "amp": False,  # its check would download
        "plots": False,  # would download a font
        "verbose": False,
        "rect": not options.mosaic,  # pictures of one shape need no padding to a square
        "mosaic": float(options.mosaic),
        "close_mosaic": min(10, options.epochs // 3),
        "fliplr": 0.5 if augment else 0.0,
        "translate": 0.1 if augment else 0.0,
        "scale": 0.3 if augment else 0.0,
        "hsv_h": 0.0,  # pictures are grey
        "hsv_s": 0.0,
        "hsv_v": 0.3 if augment else 0.0,
    }


def _set_up_torch(trainer: Any, threads: int) -> None:
    """Undo Ultralytics' choice of one thread; channels last is faster on a CPU, and it applies that to GPUs only."""
    import torch

    if trainer.device.type == "cpu":
        torch.set_num_threads(threads)
        trainer.model.to(memory_format=torch.channels_last)


def _report(trainer: Any) -> None:
    if trainer.epoch >= trainer.epochs:
        return  # called once more after the last epoch, for the best weights
    losses = ", ".join(f"{name.removesuffix('_loss')} {float(value):.3f}" for name, value in trainer.tloss.items())
    map50 = float(trainer.metrics.get("metrics/mAP50(B)", 0))
    log.info("epoch %d of %d: losses %s; val mAP50 %.3f", trainer.epoch + 1, trainer.epochs, losses, map50)


def _read_curve(path: Path) -> pd.DataFrame:
    """Ultralytics' own log without its times."""
    table = tables.read_csv(path)
    table.columns = [str(name).strip() for name in table.columns]
    absent = sorted(set(CURVE_COLUMNS) - set(table.columns))
    assert not absent, f"Ultralytics' log lacks {absent}"
    return table[list(CURVE_COLUMNS)].rename(columns=CURVE_COLUMNS)

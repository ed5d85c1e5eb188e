"""Training by the Ultralytics trainer."""

from __future__ import annotations

import logging
import math
from copy import copy
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.detect.dataset import dataset_images
from polarsim.detect.detectors.devices import choose_device, computes_bfloat16
from polarsim.detect.detectors.families import Trained, Training
from polarsim.detect.detectors.yolo.library import ultralytics
from polarsim.detect.detectors.yolo.weights import load_start
from polarsim.detect.nms import MAX_BOXES
from polarsim.detect.split import TRAIN, VAL
from polarsim.errors import DetectError, with_path
from polarsim.formats import tables
from polarsim.formats.files import write_text
from polarsim.photo import BOX_CLASSES

CURVE_COLUMNS = {  # column of results.csv of Ultralytics -> column of the curve
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
EDGE_COLUMNS = ("train/dfl_loss", "val/dfl_loss")
log = logging.getLogger("polarsim")


def train(training: Training) -> Trained:
    """Train, see `Family.train`."""
    run = training.folder
    _link(training.dataset, run)
    trainer = _fit(run, training)
    state = ultralytics(run.parent).load_checkpoint(str(trainer.best))[0].state_dict()
    return Trained({name: value.half() for name, value in state.items()}, _read_curve(Path(trainer.csv)))


def _link(dataset: Path, run: Path) -> None:
    """Write image lists and links to the folders of the data set.

    Ultralytics writes caches next to the labels without resolving links. The links keep the caches out of the data set.
    """
    for part in (TRAIN, VAL):
        for kind in ("images", "labels"):
            (run / kind).mkdir(parents=True, exist_ok=True)
            link = run / kind / part
            link.unlink(missing_ok=True)
            link.symlink_to((dataset / kind / part).resolve(), target_is_directory=True)
        write_text(
            run / f"{part}.txt", "".join(f"./images/{part}/{key}.png\n" for key in dataset_images(dataset, part))
        )
    names = "".join(f"  {number}: {name}\n" for number, name in enumerate(BOX_CLASSES))
    write_text(run / "data.yaml", f"path: {run.resolve()}\ntrain: {TRAIN}.txt\nval: {VAL}.txt\nnames:\n{names}")


def _fit(run: Path, training: Training) -> Any:
    """Run the Ultralytics trainer, new or resumed, and return it."""
    options, library = training.options, ultralytics(run.parent)
    last = run / "out" / "weights" / "last.pt"
    arguments = _arguments(run, training)
    if _unfinished(last, library):
        log.info("resuming the training in %s", run)
        arguments |= {"model": str(last), "resume": str(last)}
    start = None
    if options.start_weights:
        start = load_start(options.start_weights, options.model, run.parent)

    class Validator(library.DetectionValidator):  # type: ignore[name-defined, misc]
        def postprocess(self, preds: Any) -> list[dict[str, Any]]:
            detections = library.non_max_suppression(preds, self.args.conf, self.args.iou, max_det=self.args.max_det)
            return [{"bboxes": x[:, :4], "conf": x[:, 4], "cls": x[:, 5], "extra": x[:, 6:]} for x in detections]

    class Trainer(library.DetectionTrainer):  # type: ignore[name-defined, misc]
        def get_model(self, cfg: Any = None, weights: Any = None, verbose: bool = False) -> Any:
            return super().get_model(cfg, weights or start, verbose)

        def build_optimizer(self, *args: Any, **kwargs: Any) -> Any:
            optimizer = super().build_optimizer(*args, **kwargs)
            for group in optimizer.param_groups:
                group["fused"] = True  # one kernel instead of hundreds; Ultralytics sets this on GPUs only
            return optimizer

        def get_validator(self) -> Any:
            return Validator(self.test_loader, save_dir=self.save_dir, args=copy(self.args), _callbacks=self.callbacks)

    trainer = Trainer(overrides=arguments)
    trainer.add_callback("on_train_start", lambda t: _set_up_torch(t, training))
    trainer.add_callback("on_fit_epoch_end", _report)
    with with_path(run):
        trainer.train()
        if not trainer.best.is_file() or not math.isfinite(float(sum(trainer.tloss.values()))):
            raise DetectError("training diverged: lower detect.training.learning_rate")
    return trainer


def _unfinished(checkpoint: Path, library: Any) -> bool:
    """Return whether a checkpoint is complete and belongs to an unfinished training."""
    try:
        return bool(checkpoint.is_file() and library.load_checkpoint(str(checkpoint))[1]["epoch"] >= 0)
    except Exception:  # torch raises various exceptions for truncated files
        return False


def _arguments(run: Path, training: Training) -> dict[str, Any]:
    """Return all arguments that differ from the defaults of Ultralytics."""
    options, augment = training.options, training.options.augment
    return {
        "model": f"{options.model}.yaml",
        "data": str(run / "data.yaml"),
        "project": str(run.resolve()),
        "name": "out",
        "exist_ok": True,
        "epochs": options.epochs,
        "patience": options.epochs,  # no early stop, so that all detectors have equal training
        "imgsz": training.imgsz,
        "batch": options.batch,
        "nbs": options.batch,  # one step per batch, without accumulation of gradients over 64 images
        "optimizer": "AdamW",  # "auto" overrides lr0
        "lr0": options.learning_rate,
        "lrf": 0.05,
        "cos_lr": True,
        "warmup_epochs": min(1.0, options.epochs / 10),
        "warmup_bias_lr": 0.0,
        "device": "0" if choose_device(training.prediction.device) == "cuda" else "cpu",
        "iou": training.prediction.nms_iou,  # validation as in prediction
        "max_det": MAX_BOXES,
        "seed": training.seed,
        "deterministic": True,
        "pretrained": False,  # avoids a download; `Trainer.get_model` loads the weights of the options
        "amp": False,  # avoids a download by the AMP check
        "plots": False,  # avoids the download of a font
        "verbose": False,
        "rect": not options.mosaic,  # images of equal shape need no padding to a square
        "mosaic": float(options.mosaic),
        "close_mosaic": min(10, options.epochs // 3),
        "fliplr": 0.5 if augment else 0.0,
        "translate": 0.1 if augment else 0.0,
        "scale": 0.3 if augment else 0.0,
        "hsv_h": 0.0,  # images are grey
        "hsv_s": 0.0,
        "hsv_v": 0.3 if augment else 0.0,
    }


def _set_up_torch(trainer: Any, training: Training) -> None:
    """Set the number of threads, and enable channels last and bfloat16, which Ultralytics uses on GPUs only."""
    import torch

    if trainer.device.type == "cpu":
        torch.set_num_threads(training.threads)
        trainer.model.to(memory_format=torch.channels_last)
        trainer.amp = computes_bfloat16(training.options.precision, "cpu")  # an earlier setting starts a download


def _report(trainer: Any) -> None:
    if trainer.epoch >= trainer.epochs:
        return  # additional call after the last epoch, for the best weights
    losses = ", ".join(f"{name.removesuffix('_loss')} {float(value):.3f}" for name, value in trainer.tloss.items())
    map50 = float(trainer.metrics.get("metrics/mAP50(B)", 0))
    log.info("epoch %d of %d: losses %s; val mAP50 %.3f", trainer.epoch + 1, trainer.epochs, losses, map50)


def _read_curve(path: Path) -> pd.DataFrame:
    """Read the log of Ultralytics without the time columns."""
    table = tables.read_csv(path)
    table.columns = [str(name).strip() for name in table.columns]
    absent = sorted(set(CURVE_COLUMNS) - set(table.columns) - set(EDGE_COLUMNS))  # YOLO26 has no edge columns
    assert not absent, f"the log of Ultralytics lacks {absent}"
    return table[[name for name in CURVE_COLUMNS if name in table.columns]].rename(columns=CURVE_COLUMNS)

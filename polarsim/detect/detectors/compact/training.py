"""Training of `compact`: AdamW, warm-up and cosine schedule, averaged weights, one checkpoint per epoch."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import torch

from polarsim.detect import metrics
from polarsim.detect.detectors.compact.loss import losses, mask_loss
from polarsim.detect.detectors.compact.network import STRIDE, Compact
from polarsim.detect.detectors.compact.pictures import TrainingImage, TrainingImages, augment, batches, class_shares
from polarsim.detect.detectors.compact.weights import decode_boxes, network, to_input
from polarsim.detect.detectors.devices import choose_device, computes_bfloat16
from polarsim.detect.detectors.families import Trained, Training
from polarsim.detect.detectors.files import load_tensors, read_detector, save_tensors
from polarsim.detect.split import TRAIN, VAL
from polarsim.errors import DetectError, with_path
from polarsim.geometry import masks
from polarsim.randomness import generator
from polarsim.run_files.class_masks import CLASSES, IGNORED

_WARM_UP, _WARM_UP_SHARE = 100, 0.25  # maximum number of warm-up steps, and maximum share of all steps
_LAST_RATE = 0.02  # final learning rate relative to the peak
_DECAY = 0.01  # weight decay of convolutions; none for biases and norms
_AVERAGE = 0.98  # decay of the averaged weights per step; Polyak and Juditsky, SIAM J. Control 30 (1992) 838
_MAX_GRADIENT_NORM = 10.0  # maximum norm of the gradient
_MIN_MAJORITY = 0.5  # minimum share of the class of a cell in the IoU of validation
_TRAINED = ("module", "average", "optimizer")  # fields of `TrainingState` with a state of torch
log = logging.getLogger("polarsim")


@dataclass
class TrainingState:
    """State of a training, stored in checkpoints."""

    module: Compact
    average: Compact  # averaged weights, used for validation and output
    optimizer: torch.optim.Optimizer
    steps: int = 0
    best: dict[str, Any] = field(default_factory=dict)
    best_fitness: float = -1.0
    curve: list[dict[str, float]] = field(default_factory=list)  # a row per finished epoch


class NetworkOutput(NamedTuple):
    """Network output of a batch, see `Compact`."""

    logits: torch.Tensor
    boxes: torch.Tensor
    masks: torch.Tensor | None  # logits; None without a mask head


def train(training: Training) -> Trained:
    """Train, see `Family.train`. A resumed training gives the same bytes as an uninterrupted training.

    If the training diverges after the first epoch, it stops with a warning and returns the best weights.
    """
    options, checkpoint = training.options, training.folder / "checkpoint.pt"
    torch.set_num_threads(training.threads)
    torch.backends.cudnn.deterministic, torch.backends.cudnn.benchmark = True, False
    device = choose_device(training.prediction.device)
    pictures, held_out = (
        TrainingImages(training.dataset, part, training.imgsz, options.masks) for part in (TRAIN, VAL)
    )
    state = _start(training, device)
    _resume(state, checkpoint)
    for epoch in range(len(state.curve), options.epochs):
        losses_of_epoch = _train_epoch(state, pictures, epoch, training, device)
        if not np.isfinite(list(losses_of_epoch.values())).all():
            if not state.best:
                raise DetectError("training diverged: lower detect.training.learning_rate")
            log.warning(
                "training diverged in epoch %d of %d, using the best weights of earlier epochs; "
                "lower detect.training.learning_rate", epoch + 1, options.epochs,
            )  # fmt: skip
            break
        row = {"epoch": epoch + 1} | losses_of_epoch
        row |= _validate(state.average, held_out, training, device)
        state.curve.append(row)
        fitness = fitness_of(row)
        if fitness >= state.best_fitness:  # the later epoch in a tie, because of its lower learning rate
            state.best_fitness, state.best = fitness, _half(state.average)
        _write_checkpoint(state, checkpoint)
        log.info(
            "epoch %d of %d: losses class %.3f, box %.3f; val mAP50 %.3f",
            epoch + 1, options.epochs, row["train_class_loss"], row["train_box_loss"], row["val_map50"],
        )  # fmt: skip
    return Trained(state.best, pd.DataFrame(state.curve).round(6))


def fitness_of(row: dict[str, float]) -> float:
    """Return the selection criterion of weights: mAP weighted as by Ultralytics, plus the mask IoU."""
    return 0.1 * row["val_map50"] + 0.9 * row["val_map50_95"] + row.get("val_mask_iou", 0.0)


def _start(training: Training, device: str) -> TrainingState:
    options = training.options
    with torch.random.fork_rng(devices=[]):  # on the CPU, so that initial weights do not depend on the device
        torch.manual_seed(int(generator(training.seed, "detect", "weights").integers(2**31)))
        module, average = (network(options.model, masks=options.masks) for _ in range(2))
        if options.start_weights:
            with with_path(options.start_weights):
                module = network(options.model, read_detector(options.start_weights).state, options.masks)
    average.load_state_dict(module.state_dict())
    module, average = module.to(device), average.to(device).eval()
    kernels = [value for value in module.parameters() if value.ndim > 1]
    vectors = [value for value in module.parameters() if value.ndim <= 1]
    groups = [{"params": kernels, "weight_decay": _DECAY}, {"params": vectors, "weight_decay": 0.0}]
    return TrainingState(module, average, torch.optim.AdamW(groups, lr=options.learning_rate, fused=True))


def _train_epoch(
    state: TrainingState, pictures: TrainingImages, epoch: int, training: Training, device: str
) -> dict[str, float]:
    """Train one epoch; return mean losses. Random numbers depend only on seed and epoch."""
    options = training.options
    random = generator(training.seed, "detect", "epoch", epoch)
    order = random.permutation(len(pictures))
    steps = math.ceil(len(order) / options.batch)
    totals: list[dict[str, float]] = []
    bfloat16 = computes_bfloat16(options.precision, device)
    state.module.train()
    for batch in batches(pictures, order, options.batch):
        rate = options.learning_rate * _rate(state.steps, steps * options.epochs)
        for group in state.optimizer.param_groups:
            group["lr"] = rate
        augmented = [augment(picture, random) for picture in batch] if options.augment else batch
        with torch.autocast(device, torch.bfloat16, enabled=bfloat16):
            answers = _forward(state.module, augmented, device)
        parts = _losses(answers, augmented, _shares(augmented), device)
        state.optimizer.zero_grad()
        sum(parts.values()).backward()  # type: ignore[union-attr]
        torch.nn.utils.clip_grad_norm_(state.module.parameters(), _MAX_GRADIENT_NORM)
        state.optimizer.step()
        state.steps += 1
        _update_average(state)
        totals.append({name: float(part.detach()) for name, part in parts.items()})
    return _means("train", totals)


def _rate(step: int, steps: int) -> float:
    """Return the learning rate relative to the peak: a linear warm-up multiplied by a cosine.

    `SequentialLR` of torch starts the cosine after the warm-up and has different rounding.
    """
    falling = _LAST_RATE + (1 - _LAST_RATE) * (1 + math.cos(math.pi * step / steps)) / 2
    return min(1.0, (step + 1) / min(_WARM_UP, _WARM_UP_SHARE * steps)) * falling


def _update_average(state: TrainingState) -> None:
    """Update the moving average of the weights. Unlike this, `AveragedModel` of torch copies the first step."""
    keep = min(_AVERAGE, (1 + state.steps) / (10 + state.steps))  # lower weight of the initial values in early steps
    with torch.no_grad():
        for mean, value in zip(state.average.state_dict().values(), state.module.state_dict().values(), strict=True):
            if mean.is_floating_point():
                mean.lerp_(value, 1 - keep)
            else:
                mean.copy_(value)


def _validate(module: Compact, pictures: TrainingImages, training: Training, device: str) -> dict[str, float]:
    """Return losses, mAP@0.5 and mAP@[0.5:0.95] over classes with labels, and mask IoU of rocks and shadows."""
    totals, validated, detections = [], [], []
    confusion = np.zeros((len(CLASSES), len(CLASSES)), int)
    for batch in batches(pictures, np.arange(len(pictures)), training.options.batch):
        with torch.inference_mode():
            answers, targets = _forward(module, batch, device), _shares(batch)
            totals.append({name: float(part) for name, part in _losses(answers, batch, targets, device).items()})
        validated += batch
        detections += decode_boxes(answers.logits, answers.boxes, training.prediction)
        if answers.masks is not None and targets is not None:
            confusion += _confusion(answers.masks, targets)
    mean = metrics.mean_precision([(picture.classes, picture.boxes) for picture in validated], detections)
    row = _means("val", totals) | {"val_map50": float(mean[0]), "val_map50_95": float(mean.mean())}
    if training.options.masks:
        row["val_mask_iou"] = _mean_iou(confusion)
    return row


def _forward(module: Compact, batch: list[TrainingImage], device: str) -> NetworkOutput:
    features = module.features(to_input(np.stack([picture.pixels for picture in batch]), device))
    return NetworkOutput(*module.boxes(features), None if module.mask is None else module.masks(features))


def _losses(
    answers: NetworkOutput, batch: list[TrainingImage], targets: np.ndarray | None, device: str
) -> dict[str, torch.Tensor]:
    labels = [
        (torch.from_numpy(picture.classes).to(device), torch.from_numpy(picture.boxes).float().to(device))
        for picture in batch
    ]
    class_loss, box_loss = losses(answers.logits, answers.boxes, labels)
    parts = {"class_loss": class_loss, "box_loss": box_loss}
    if answers.masks is not None and targets is not None:
        parts["mask_loss"] = mask_loss(answers.masks, torch.from_numpy(targets).to(device))
    return parts


def _means(part: str, steps: list[dict[str, float]]) -> dict[str, float]:
    return {f"{part}_{name}": sum(step[name] for step in steps) / len(steps) for name in steps[0]}


def _mean_iou(confusion: np.ndarray) -> float:
    """Return the mean IoU of rocks and shadows over classes with pixels; 0 without pixels."""
    by_class = masks.class_iou(confusion)[1:]
    return float(by_class[~np.isnan(by_class)].mean()) if not np.isnan(by_class).all() else 0.0


def _confusion(logits: torch.Tensor, targets: np.ndarray) -> np.ndarray:
    """Return the confusion matrix of cells with a majority class."""
    truth = np.where(targets.max(axis=1) > _MIN_MAJORITY, targets.argmax(axis=1), IGNORED)
    return masks.confusion_matrix(truth, logits.argmax(dim=1).cpu().numpy(), len(CLASSES))


def _shares(batch: list[TrainingImage]) -> np.ndarray | None:
    """Return the class shares (b, classes, h, w) of cells; None without masks."""
    by_picture = [class_shares(picture.mask, STRIDE) for picture in batch if picture.mask is not None]
    return np.stack(by_picture) if by_picture else None


def _half(module: Compact) -> dict[str, Any]:
    values = module.state_dict().items()
    return {name: (value.half() if value.is_floating_point() else value).cpu().clone() for name, value in values}


def _write_checkpoint(state: TrainingState, path: Path) -> None:
    trained = {name: value.state_dict() for name, value in vars(state).items() if name in _TRAINED}
    save_tensors(path, vars(state) | trained)


def _resume(state: TrainingState, path: Path) -> None:
    """Restore a state from a checkpoint, if a valid checkpoint exists."""
    try:
        content = load_tensors(path)
    except DetectError:  # missing or incomplete
        return
    for name, value in content.items():
        if name in _TRAINED:
            getattr(state, name).load_state_dict(value)
        else:
            setattr(state, name, value)
    log.info("resuming the training in %s after epoch %d", path.parent, len(state.curve))

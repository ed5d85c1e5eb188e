"""Networks with fresh or given weights, and how they predict."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from polarsim.detect.detectors.compact.network import WIDTHS, Compact
from polarsim.detect.detectors.devices import choose_device
from polarsim.detect.detectors.families import MAX_BOXES, LoadedDetector, LoadedMasks
from polarsim.detect.detectors.files import Detector
from polarsim.detect.nms import suppress_by_class
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.photo import BOX_CLASSES
from polarsim.run_files.class_masks import CLASSES

Module = TypeVar("Module", bound=nn.Module)
_MASK_HEAD = "mask."  # how its tensors' names begin
_MOST = 1000  # boxes of a picture and class that suppression looks at, the surest


def network(model: str, state: dict[str, Any] | None = None, masks: bool | None = None) -> Compact:
    """A network, its weights drawn from torch's generator where no state is given.

    Parameters
    ----------
    masks
        Whether it has a head for masks; none: where the state has one. A head that the state lacks is drawn, and one
        that is not asked for is left out.

    Raises
    ------
    DetectError
        The state is of another network.
    """
    masks = has_masks(state) if masks is None else masks
    module = Compact(WIDTHS[model], len(BOX_CLASSES), len(CLASSES) if masks else 0)
    module = module.to(memory_format=torch.channels_last)
    if state is not None:
        own = {name: value for name, value in module.state_dict().items() if name.startswith(_MASK_HEAD)}
        given = {name: value for name, value in state.items() if masks or not name.startswith(_MASK_HEAD)}
        try:
            # Copies into the network's own precision.
            module.load_state_dict(given if has_masks(given) else given | own)
        except RuntimeError as error:
            raise DetectError(f"weights do not fit {model}: {str(error).splitlines()[0]}") from error
    return module


def has_masks(state: dict[str, Any] | None) -> bool:
    """Whether weights have a head for masks."""
    return any(name.startswith(_MASK_HEAD) for name in state or {})


def load(detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:  # noqa: ARG001 - of the interface
    """See `Family.load`."""
    torch.set_num_threads(threads)
    device = choose_device(options.device)
    module = _fused(network(detector.model, detector.state).eval()).to(device)

    def detect(pictures: np.ndarray) -> list[np.ndarray]:
        with torch.inference_mode():
            logits, boxes = module(as_input(pictures, device))
        return found(logits, boxes, options)

    return detect


def load_masks(detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:
    """See `Family.load_masks`."""
    if not has_masks(detector.state):
        raise DetectError("a detector without a head for masks: train one with detect.training.masks")
    torch.set_num_threads(threads)
    device = choose_device(options.device)
    module = _fused(network(detector.model, detector.state).eval()).to(device)

    def segment(pictures: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            logits = module.masks(module.features(as_input(pictures, device)))
            return np.asarray(logits.softmax(dim=1).cpu().numpy())

    return segment


def _fused(module: Module) -> Module:
    """The same network with every batch norm in the convolution before it; it can predict and no longer train."""
    for child in module.children():
        _fused(child)
    if isinstance(module, nn.Sequential):
        for n, (first, second) in enumerate(pairwise(list(module))):
            if isinstance(first, nn.Conv2d) and isinstance(second, nn.BatchNorm2d):
                module[n], module[n + 1] = fuse_conv_bn_eval(first, second), nn.Identity()
    return module


def as_input(pictures: np.ndarray, device: str) -> Tensor:
    """Pictures (b, h, w) uint8 as the network takes them."""
    batch = torch.from_numpy(pictures)[:, None].to(device).float().div_(255)
    return batch.contiguous(memory_format=torch.channels_last)


def found(logits: Tensor, boxes: Tensor, options: PredictionOptions) -> list[np.ndarray]:
    """What the network's answers mean, as a `LoadedDetector` gives it."""
    scores, boxes = logits.sigmoid().flatten(2).cpu(), boxes.flatten(3).cpu()
    pictures = []
    for score, box in zip(scores, boxes, strict=True):
        rows = [np.zeros((0, 6))]
        for kind in range(len(score)):
            surest, index = score[kind].topk(min(_MOST, score.shape[1]))
            likely = surest > options.confidence
            surest, corners = surest[likely], box[kind][:, index[likely]].T
            rows.append(np.column_stack([corners, surest, np.full(len(surest), kind)]).astype(float))
        pictures.append(suppress_by_class(np.concatenate(rows), options.nms_iou, MAX_BOXES))
    return pictures

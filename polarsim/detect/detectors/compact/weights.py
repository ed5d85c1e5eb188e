"""Networks with initial or given weights, and inference."""

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
from polarsim.detect.detectors.families import LoadedDetector, LoadedMasks
from polarsim.detect.detectors.files import Detector
from polarsim.detect.nms import suppress_by_class
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.photo import BOX_CLASSES
from polarsim.run_files.class_masks import CLASSES

Module = TypeVar("Module", bound=nn.Module)
_MASK_HEAD = "mask."  # prefix of the tensor names of the mask head
_MAX_CANDIDATES = 1000  # maximum number of boxes of an image and class before suppression


def network(model: str, state: dict[str, Any] | None = None, masks: bool | None = None) -> Compact:
    """Create a network with the weights `state`, or with random weights of the torch generator.

    With `masks`, a mask head missing in the state gets random weights; with False, a mask head in the state is ignored;
    with None, the network has a mask head if the state has one.
    """
    masks = has_masks(state) if masks is None else masks
    module = Compact(WIDTHS[model], len(BOX_CLASSES), len(CLASSES) if masks else 0)
    module = module.to(memory_format=torch.channels_last)
    if state is not None:
        initial = {name: value for name, value in module.state_dict().items() if name.startswith(_MASK_HEAD)}
        given = {name: value for name, value in state.items() if masks or not name.startswith(_MASK_HEAD)}
        try:
            # Converts to the precision of the network.
            module.load_state_dict(given if has_masks(given) else given | initial)
        except RuntimeError as error:
            raise DetectError(f"weights do not fit {model}: {str(error).splitlines()[0]}") from error
    return module


def has_masks(state: dict[str, Any] | None) -> bool:
    """Return whether weights include a mask head."""
    return any(name.startswith(_MASK_HEAD) for name in state or {})


def load(detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:  # noqa: ARG001 - of the interface
    """Load a detector for inference, see `Family.load`."""
    module, device = _loaded(detector, options, threads)

    def detect(pictures: np.ndarray) -> list[np.ndarray]:
        with torch.inference_mode():
            logits, boxes = module(to_input(pictures, device))
        return decode_boxes(logits, boxes, options)

    return detect


def load_masks(detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:
    """Load a detector for mask inference, see `Family.load_masks`."""
    if not has_masks(detector.state):
        raise DetectError("the detector has no mask head: train a detector with detect.training.masks")
    module, device = _loaded(detector, options, threads)

    def segment(pictures: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            logits = module.masks(module.features(to_input(pictures, device)))
            return np.asarray(logits.softmax(dim=1).cpu().numpy())

    return segment


def _loaded(detector: Detector, options: PredictionOptions, threads: int) -> tuple[Compact, str]:
    torch.set_num_threads(threads)
    device = choose_device(options.device)
    return _fused(network(detector.model, detector.state).eval()).to(device), device


def _fused(module: Module) -> Module:
    """Fuse every batch norm into the preceding convolution, for inference only."""
    for child in module.children():
        _fused(child)
    if isinstance(module, nn.Sequential):
        for n, (first, second) in enumerate(pairwise(list(module))):
            if isinstance(first, nn.Conv2d) and isinstance(second, nn.BatchNorm2d):
                module[n], module[n + 1] = fuse_conv_bn_eval(first, second), nn.Identity()
    return module


def to_input(pictures: np.ndarray, device: str) -> Tensor:
    """Convert images (b, h, w) uint8 to network input."""
    batch = torch.from_numpy(pictures)[:, None].to(device).float().div_(255)
    return batch.contiguous(memory_format=torch.channels_last)


def decode_boxes(logits: Tensor, boxes: Tensor, options: PredictionOptions) -> list[np.ndarray]:
    """Convert network output to the boxes of a `LoadedDetector`."""
    scores, boxes = logits.sigmoid().flatten(2).cpu(), boxes.flatten(3).cpu()
    pictures = []
    for score, box in zip(scores, boxes, strict=True):
        rows = [np.zeros((0, 6))]
        for kind in range(len(score)):
            surest, index = score[kind].topk(min(_MAX_CANDIDATES, score.shape[1]))
            likely = surest > options.confidence
            surest, corners = surest[likely], box[kind][:, index[likely]].T
            rows.append(np.column_stack([corners, surest, np.full(len(surest), kind)]).astype(float))
        pictures.append(suppress_by_class(np.concatenate(rows), options.nms_iou))
    return pictures

"""Networks with fresh or given weights, and how they predict."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from polarsim.detect.detectors.compact.network import WIDTHS, Compact
from polarsim.detect.detectors.devices import choose_device
from polarsim.detect.detectors.families import MAX_BOXES, LoadedDetector
from polarsim.detect.detectors.files import Detector
from polarsim.detect.nms import suppress_by_class
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.photo import BOX_CLASSES

_MOST = 1000  # boxes of a picture and class that suppression looks at, the surest


def network(model: str, state: dict[str, Any] | None = None) -> Compact:
    """A network, its weights drawn from torch's generator where no state is given.

    Raises
    ------
    DetectError
        The state is of another network.
    """
    module = Compact(WIDTHS[model], len(BOX_CLASSES)).to(memory_format=torch.channels_last)
    if state is not None:
        try:
            module.load_state_dict(state)  # copies into the network's own precision
        except RuntimeError as error:
            raise DetectError(f"weights do not fit {model}: {str(error).splitlines()[0]}") from error
    return module


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


def _fused(module: nn.Module) -> nn.Module:
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

"""Weights in and out: detectors as networks that predict, and weights to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from polarsim.detect.detectors.devices import choose_device, load_torch
from polarsim.detect.detectors.families import MAX_BOXES, LoadedDetector, LoadedMasks
from polarsim.detect.detectors.files import Detector, read_detector
from polarsim.detect.detectors.yolo.library import ultralytics
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.formats.readers import reason_of
from polarsim.photo import BOX_CLASSES


def load(detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:
    """See `Family.load`."""
    torch, library = load_torch(), ultralytics(folder)
    torch.set_num_threads(threads)
    device = choose_device(options.device)
    module = network(detector, folder).to(device, memory_format=torch.channels_last)

    def detect(pictures: np.ndarray) -> list[np.ndarray]:
        batch = torch.from_numpy(pictures)[:, None].expand(-1, 3, -1, -1).to(device)
        with torch.inference_mode():
            found = library.non_max_suppression(
                module(batch.float().contiguous(memory_format=torch.channels_last) / 255),
                conf_thres=options.confidence,
                iou_thres=options.nms_iou,
                max_det=MAX_BOXES,
            )
        return [result.cpu().numpy().astype(float) for result in found]

    return detect


def load_masks(detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:  # noqa: ARG001 - of the interface
    """See `Family.load_masks`."""
    raise DetectError(f"{detector.model} has no masks, choose a detector of compact or compact-l")


def network(detector: Detector, folder: Path) -> Any:
    """The detector as a torch module that is ready to predict. `folder`: see `ultralytics`."""
    module = ultralytics(folder).DetectionModel(f"{detector.model}.yaml", nc=len(BOX_CLASSES), verbose=False)
    try:
        module.load_state_dict({name: value.float() for name, value in detector.state.items()})
    except RuntimeError as error:
        raise DetectError(f"weights do not fit {detector.model}: {str(error).splitlines()[0]}") from error
    return module.eval().fuse(verbose=False)


def load_start(path: Path, model: str, folder: Path) -> Any:
    """Weights to start a training from, as a torch module: a detector of ours or an Ultralytics checkpoint.

    Raises
    ------
    DetectError
        The file holds no such weights.
    """
    library = ultralytics(folder)
    try:
        detector = read_detector(path)
    except DetectError:
        try:
            return library.load_checkpoint(str(path))[0]  # runs no code in it: `library` has seen to that
        except Exception as error:
            raise DetectError(f"no weights of {model}, {reason_of(error)}", path=path) from error
    module = library.DetectionModel(f"{detector.model}.yaml", nc=len(BOX_CLASSES), verbose=False)
    module.load_state_dict({name: value.float() for name, value in detector.state.items()})
    return module

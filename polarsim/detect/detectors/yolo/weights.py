"""Loading of weights for inference and for the start of a training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from polarsim.detect.detectors.devices import choose_device, load_torch
from polarsim.detect.detectors.families import LoadedDetector, LoadedMasks
from polarsim.detect.detectors.files import Detector, read_detector
from polarsim.detect.detectors.yolo.library import ultralytics
from polarsim.detect.nms import MAX_BOXES
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.formats.readers import reason_of
from polarsim.photo import BOX_CLASSES


def load(detector: Detector, folder: Path, options: PredictionOptions, threads: int) -> LoadedDetector:
    """Load a detector for inference, see `Family.load`."""
    torch, library = load_torch(), ultralytics(folder)
    torch.set_num_threads(threads)
    device = choose_device(options.device)
    module = network(detector, folder).eval().fuse(verbose=False).to(device, memory_format=torch.channels_last)

    def detect(pictures: np.ndarray) -> list[np.ndarray]:
        batch = torch.from_numpy(pictures)[:, None].expand(-1, 3, -1, -1).to(device)
        with torch.inference_mode():
            detections = library.non_max_suppression(
                module(batch.float().contiguous(memory_format=torch.channels_last) / 255),
                conf_thres=options.confidence,
                iou_thres=options.nms_iou,
                max_det=MAX_BOXES,
            )
        return [result.cpu().numpy().astype(float) for result in detections]

    return detect


def load_masks(detector: Detector, options: PredictionOptions, threads: int) -> LoadedMasks:  # noqa: ARG001 - of the interface
    """Raise an error, because YOLO models have no masks."""
    raise DetectError(f"model {detector.model} has no masks, choose a detector of model compact or compact-l")


def network(detector: Detector, folder: Path) -> Any:
    """Return the detector as a torch module. `folder`: see `ultralytics`."""
    module = ultralytics(folder).DetectionModel(f"{detector.model}.yaml", nc=len(BOX_CLASSES), verbose=False)
    try:
        module.load_state_dict({name: value.float() for name, value in detector.state.items()})
    except RuntimeError as error:
        raise DetectError(f"weights do not fit {detector.model}: {str(error).splitlines()[0]}") from error
    return module


def load_start(path: Path, model: str, folder: Path) -> Any:
    """Load initial weights as a torch module, from a polarsim detector or an Ultralytics checkpoint."""
    try:
        detector = read_detector(path)
    except DetectError:
        try:
            return ultralytics(folder).load_checkpoint(str(path))[0]  # safe mode, see `library`
        except Exception as error:
            raise DetectError(f"no weights of {model}, {reason_of(error)}", path=path) from error
    if detector.model != model:
        raise DetectError(f"weights of {detector.model}, expected {model}", path=path)
    return network(detector, folder)

"""Published detector of images unlike POLAR's: widths and calibration from held-out scenes, and a model card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from polarsim.detect import detectors, metrics
from polarsim.detect.calibration import Calibration, calibrate_boxes, calibration_error, fit_calibration
from polarsim.detect.dataset import dataset_images
from polarsim.detect.frame import read_picture
from polarsim.detect.inference_widths import (
    ClassInferenceWidths,
    InferenceWidths,
    choose_sizes,
    merge,
    widths_text,
)
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import predict_images
from polarsim.detect.split import VAL
from polarsim.errors import DetectError, with_path
from polarsim.formats import yolo
from polarsim.formats.files import write_text
from polarsim.photo import BOX_CLASSES, REFERENCE_WIDTH_PX
from polarsim.scenes.options import SCENE_NAME

WIDTHS = (256, 384, 512, 640)  # candidate inference widths, px: scenes are 640 px wide
_GATES_PX = (64.0, 128.0, 256.0, 384.0)  # candidate gates: rocks are up to 70 % as wide as the image
_HALVES = (0, 1)
Labels = tuple[np.ndarray, np.ndarray]  # classes (n,), boxes (n, 4)


@dataclass(frozen=True)
class HeldOutImages:
    """Labels, predictions by width, and scene number of images that were not used for training.

    Boxes are in pixels of images `REFERENCE_WIDTH_PX` wide.
    """

    labels: list[Labels]
    found: Mapping[int, list[np.ndarray]]
    scenes: np.ndarray

    def half(self, number: int) -> HeldOutImages:
        """Return the images of every other scene."""
        chosen = np.flatnonzero(self.scenes % len(_HALVES) == number)
        found = {width: [rows[n] for n in chosen] for width, rows in self.found.items()}
        return HeldOutImages([self.labels[n] for n in chosen], found, self.scenes[chosen])

    def merged(self, sizes: ClassInferenceWidths, nms_iou: float) -> list[np.ndarray]:
        """Return the boxes of each image, merged over the widths."""
        return [
            merge({width: rows[n] for width, rows in self.found.items()}, sizes, nms_iou, REFERENCE_WIDTH_PX)
            for n in range(len(self.labels))
        ]


def publish_field_detector(
    *, weights: Path, dataset: Path, detector: Path, card: Path, options: PredictionOptions, threads: int
) -> None:
    """Write the detector with inference widths, calibration and a model card in Markdown.

    Widths and calibration are selected on the validation scenes of the data set. The metrics of the card are those of
    each half of these scenes with widths and calibration of the other half.
    """
    trained = detectors.read_detector(weights)
    with with_path(weights):
        loaded = detectors.load_detector(trained, detector.parent, options, threads)
    images = predict_held_out(loaded, dataset, options.widths or WIDTHS, options.nms_iou)
    sizes, calibration = _chosen(images, options)
    labels: list[Labels] = []
    boxes: list[np.ndarray] = []
    for number in _HALVES:
        tested = images.half(number)
        chosen, fitted = _chosen(images.half(1 - number), options)
        labels += tested.labels
        boxes += [calibrate_boxes(rows, fitted) for rows in tested.merged(chosen, options.nms_iou)]
    complete = replace(
        trained,
        sizes=tuple((of_class.widths, of_class.gates_px) for of_class in sizes.by_class),
        calibration=calibration,
    )
    detectors.write_detector(detector, complete)
    write_text(card, _card(complete, labels, boxes))


def predict_held_out(
    loaded: detectors.LoadedDetector, dataset: Path, widths: Sequence[int], nms_iou: float
) -> HeldOutImages:
    """Return the predictions of a detector on the validation images of a data set of scenes."""
    labels, scenes = [], []
    found: dict[int, list[np.ndarray]] = {width: [] for width in widths}
    for key in dataset_images(dataset, VAL):
        name = SCENE_NAME.fullmatch(key)
        if not name:
            raise DetectError(f"{key!r} is not an image of a scene", path=dataset)
        picture = read_picture(dataset / "images" / VAL / f"{key}.png")
        size = REFERENCE_WIDTH_PX, round(REFERENCE_WIDTH_PX * picture.shape[0] / picture.shape[1])
        labels.append(yolo.read_boxes(dataset / "labels" / VAL / f"{key}.txt", size))
        scenes.append(int(name[2]))
        for width, rows in found.items():
            single = ClassInferenceWidths.same(InferenceWidths((width,)))
            rows.append(next(predict_images(loaded, [picture], single, nms_iou, size)))
    return HeldOutImages(labels, found, np.unique(scenes, return_inverse=True)[1])


def _chosen(images: HeldOutImages, options: PredictionOptions) -> tuple[ClassInferenceWidths, Calibration]:
    sizes = ClassInferenceWidths.named(options) or choose_sizes(
        images.labels, images.found, options.nms_iou, REFERENCE_WIDTH_PX, _GATES_PX
    )
    return sizes, fit_calibration(images.labels, images.merged(sizes, options.nms_iou))


def _card(detector: detectors.Detector, labels: Sequence[Labels], boxes: Sequence[np.ndarray]) -> str:
    ranked = metrics.rank_classes(labels, boxes, np.array([0.5]))
    precision = [float(metrics.precision_at_recalls(of_class).mean()) for of_class in ranked]
    counts = [sum(int((classes == number).sum()) for classes, _ in labels) for number in range(len(BOX_CLASSES))]
    parameters = sum(value.numel() for value in detector.state.values())
    rows = "\n".join(
        f"| {kind} | {count} | {value:.3f} |" for kind, count, value in zip(BOX_CLASSES, counts, precision, strict=True)
    )
    return f"""# Detector of rocks and shadows in images unlike POLAR's

- **Model**: {detectors.detector_name(detector.model)}, {parameters:,} parameters in half precision, {detector.epochs}
  epochs at {detector.imgsz} px, initialised with {detector.start}. Inference widths:
  {widths_text(detector.sizes)}.
- **Training data**: rendered scenes beyond the sandbox (`covers.scenes.kind: field`): generated rocks of 1 to 70 % of
  the image width on natural ground, under any Sun and sky. No photos.
- **Calibration**: expected calibration error {calibration_error(labels, boxes):.3f} on held-out scenes (IoU 0.5). It
  is not valid for photos.
- **Licence**: BSD-3-Clause, as the code.

AP@0.5 on {len(labels)} images of scenes that were not used for training:

| labels | count | AP@0.5 |
|---|---|---|
{rows}
"""

"""Detection of rocks and shadows in external images (`polarsim detect`)."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
from pydantic import ValidationError

from polarsim.detect import detectors, tone
from polarsim.detect.fusion import fuse
from polarsim.detect.grouping import detection_rows
from polarsim.detect.inference_widths import ClassInferenceWidths
from polarsim.detect.likeness import is_like_polar
from polarsim.detect.masks import MaskInference, class_mask, load_segmenter, within_boxes
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import inference_widths_of, predict_images
from polarsim.errors import DetectError, PolarsimError, with_path
from polarsim.formats import coco, png, tables, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.files import relative_to, write_bytes, writing_folder
from polarsim.formats.yaml_files import describe_error
from polarsim.geometry.images import resize_longer_side
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, NO_ROCK, WHITE_LEVEL
from polarsim.progress import track
from polarsim.run_files import class_masks

COLUMNS = ("picture", "kind", "confidence", "x0", "y0", "x1", "y1", "calibrated", "detector")
Result = TypeVar("Result")
Draw = Callable[[np.ndarray, np.ndarray, Mapping[str, np.ndarray] | None, str], np.ndarray]
_THREADS = 1  # threads of torch: images are processed in parallel because one image does not use two cores
_MIN_CONFIDENCE = 0.01  # minimum confidence before calibration
log = logging.getLogger("polarsim")


def detect_in_images(
    *,
    pictures: Sequence[Path],
    weights: Sequence[Path],
    out: Path,
    options: PredictionOptions,
    threads: int,
    confidence: float = 0.25,
    draw: Draw | None = None,
    masks: bool = False,
    elsewhere: Sequence[Path] = (),
) -> pd.DataFrame:
    """Detect objects in images of any size, 8 or 16 bits, grey or colour; return a table of `COLUMNS`, px of the image.

    Confidences are calibrated if all detectors have a calibration and the image is like POLAR's (see `likeness`). Other
    images cause a warning with calibrated detectors, and are searched by the detectors `elsewhere`, if given.

    Parameters
    ----------
    pictures
        Images and folders of images. Unreadable images are skipped with a warning.
    weights
        Detectors. Detections of several detectors are merged, see `fusion.fuse`.
    elsewhere
        Detectors of images unlike POLAR's, instead of `weights`. Empty: `weights`.
    threads
        Number of images processed in parallel, each by one thread.
    out
        Folder to write: `detections.csv`, `labels/NAME.txt` (YOLO, with the confidence as sixth field), `coco.json`
        (with `calibrated` and `detector` for each image), optionally `masks/NAME.png` (class of every pixel, see
        `class_masks`; rocks and shadows only inside written boxes) and `pictures/NAME.jpg` with masks and boxes drawn.
    draw
        Function that draws these images from 8-bit grey levels (h, w), boxes (n, 6), masks by kind, and the file name.
    confidence
        Confidence threshold of written boxes, after calibration if the detector has a calibration.
    """
    paths = _listed(pictures)
    if out.exists():
        raise DetectError("the output folder already exists: choose a new folder", path=out)
    with writing_folder(out) as folder:
        for name in ("labels", *(["masks"] if masks else []), *(["pictures"] if draw else [])):
            (folder / name).mkdir()
        groups = [_load_group(group, folder, options, masks=masks) for group in (weights, elsewhere) if group]
        widest = max(group.widest for group in groups)

        def detect(path: Path) -> _Detections | PolarsimError | OSError:
            """Detect objects in an image and write its mask and drawing, or return the error of an unreadable image."""
            try:
                pixels = _grey(read_any(path))
            except (PolarsimError, OSError) as error:
                return error
            size, shown = (pixels.shape[1], pixels.shape[0]), _detector_input(pixels, widest)
            like_polar = is_like_polar(shown)
            group = groups[0 if like_polar else -1]
            found = group.boxes(shown, size, options.nms_iou)
            found = found[found[:, 4] >= confidence]
            mask = within_boxes(class_mask(group.segmenters, shown, size), found) if masks else None
            if mask is not None:
                class_masks.write_class_mask(folder / "masks" / f"{path.stem}.png", mask)
            if draw:
                kinds = (
                    None if mask is None else {kind: mask == class_masks.CLASSES.index(kind) for kind in BOX_CLASSES}
                )
                drawn = draw(_eight_bits(pixels, pixels.dtype), found, kinds, path.name)
                _write_jpeg(folder / "pictures" / f"{path.stem}.jpg", drawn)
            return _Detections(size, found, groups[0].has_calibration and like_polar, group.name)

        detections: dict[Path, _Detections] = {}
        for path, result in _in_order(paths, detect, threads):
            if isinstance(result, Exception):
                reason = result.reason if isinstance(result, PolarsimError) else result.strerror
                log.warning("skipped: %s: %s", path, reason)
                continue
            detections[path] = result
            boxes = result.boxes
            yolo.write_boxes(
                folder / "labels" / f"{path.stem}.txt", boxes[:, 5], boxes[:, :4], result.size, boxes[:, 4]
            )
        if not detections:
            raise DetectError(f"none of {len(paths)} images can be read", path=pictures[0])
        if groups[0].has_calibration:
            _warn_uncalibrated(detections, groups[-1].name if elsewhere else "")
        table = _table(detections)
        tables.write_csv(folder / "detections.csv", table)
        names = ", ".join(path.name for path in dict.fromkeys((*weights, *elsewhere)))
        coco.write_coco_images(folder / "coco.json", _coco_images(detections, out), f"Found by {names}")
    return table


@dataclass(frozen=True)
class _Detections:
    """Detections in an image."""

    size: tuple[int, int]  # width and height of the image, px
    boxes: np.ndarray  # (n, 6) x0, y0, x1, y1 in pixels of the image, confidence, class
    calibrated: bool
    detector: str  # file names of the detectors


@dataclass(frozen=True)
class _Group:
    """Detectors whose boxes are merged."""

    name: str  # file names
    has_calibration: bool  # of all detectors
    loaded: Sequence[tuple[detectors.LoadedDetector, ClassInferenceWidths]]
    segmenters: Sequence[MaskInference]  # empty without masks

    @property
    def widest(self) -> int:
        """Maximum inference width of boxes and masks, px."""
        widths = [*(width for _, sizes in self.loaded for width in sizes.widths)]
        return max([*widths, *(width for _, of_masks in self.segmenters for width in of_masks)])

    def boxes(self, shown: np.ndarray, size: tuple[int, int], nms_iou: float) -> np.ndarray:
        """Return the boxes (n, 6) in a detector input (h, w) uint8, in pixels of the original image of a `size`."""
        parts = [next(predict_images(loaded, [shown], sizes, nms_iou, size)) for loaded, sizes in self.loaded]
        return fuse(parts, nms_iou) if len(parts) > 1 else parts[0]


def _load_group(paths: Sequence[Path], folder: Path, options: PredictionOptions, *, masks: bool) -> _Group:
    """Load detectors, optionally with their segmenters; `folder`: for files of the detectors."""
    trained = [detectors.read_detector(path) for path in paths]
    loaded = []
    for path, detector in zip(paths, trained, strict=True):
        sizes = inference_widths_of(detector, options)
        with with_path(path):
            loaded.append((detectors.load_detector(detector, folder, options, _THREADS), sizes))
    segmenters = [load_segmenter(path, options, _THREADS) for path in paths] if masks else []
    name = " ".join(path.name for path in paths)
    return _Group(name, all(detector.calibration for detector in trained), loaded, segmenters)


def _warn_uncalibrated(detections: Mapping[Path, _Detections], detector: str) -> None:
    """Log a warning if images are unlike POLAR's; `detector`: file names of detectors of such images, or empty."""
    unlike = [path.name for path, found in detections.items() if not found.calibrated]
    if unlike:
        log.warning(
            "%d of %d images are unlike POLAR's photos (few dark or clipped pixels), so that their confidences are "
            "not calibrated and %s, first %s",
            len(unlike), len(detections),
            f"{detector} is used" if detector else "most rocks may be missed", unlike[0],
        )  # fmt: skip


def _table(detections: Mapping[Path, _Detections]) -> pd.DataFrame:
    """Return the table of `COLUMNS` of all images."""
    rows = [
        (*row, found.calibrated, found.detector)
        for path, found in detections.items()
        for row in detection_rows(path.name, found.boxes)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS)).round({"confidence": 4, **dict.fromkeys(COLUMNS[3:7], 1)})


def _coco_images(detections: Mapping[Path, _Detections], out: Path) -> list[tuple[dict[str, object], list[Annotation]]]:
    """Return the row of `images` and the annotations of each image for a COCO file in the folder `out`."""
    images = []
    for number, (path, found) in enumerate(detections.items(), 1):
        image: dict[str, object] = {
            "id": number, "file_name": relative_to(path, out), "width": found.size[0], "height": found.size[1],
            "calibrated": found.calibrated, "detector": found.detector,
        }  # fmt: skip
        annotations = [
            Annotation(BOX_CLASSES[int(box[5])], NO_ROCK, box[:4], confidence=round(box[4], 4)) for box in found.boxes
        ]
        images.append((image, annotations))
    return images


def prediction_options(
    widths: Sequence[str], gates_px: Sequence[str], device: str, *, mirrored: bool = False, precision: str = "float32"
) -> PredictionOptions:
    """Parse prediction options of the command line."""
    given = {"widths": widths, "gates_px": gates_px, "device": device, "mirrored": mirrored, "precision": precision}
    try:
        return PredictionOptions.model_validate(given | {"confidence": _MIN_CONFIDENCE, "nms_iou": 0.5})
    except ValidationError as error:
        raise DetectError(describe_error(error, "gates_px")) from error


def _detector_input(pixels: np.ndarray, longest: int) -> np.ndarray:
    """Convert an image (h, w[, 3]) of 8 or 16 bits to the detector input: 8-bit grey, longer side up to `longest`."""
    grey = _grey(pixels)
    if max(grey.shape) > longest:
        # Images of more than 8 bits are linear and averaged before the tone curve.
        grey = resize_longer_side(grey, longest) if grey.dtype == np.uint8 else tone.shrink(grey, longest)
    return _eight_bits(grey, pixels.dtype)


def read_any(path: Path) -> np.ndarray:
    """Return pixels (h, w) or (h, w, 3; RGB order) of 8 or 16 bits, rotated upright."""
    pixels = png.read_png(path)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise DetectError(f"{pixels.dtype}, expected 8 or 16 bits", path=path)
    return pixels


def _listed(pictures: Sequence[Path]) -> list[Path]:
    paths: list[Path] = []
    for path in pictures:
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if file.suffix.lower() in png.SUFFIXES)
            if not inside:
                raise DetectError(f"no image in the folder, expected {', '.join(png.SUFFIXES)}", path=path)
            paths += inside
        elif path.is_file():
            paths.append(path)
        else:
            raise DetectError("no such image or folder", path=path)
    by_name: dict[str, Path] = {}
    for path in paths:
        if path.stem in by_name:
            raise DetectError(
                f"same file name as {by_name[path.stem]}: search each folder separately, or the photos of a run, "
                "results/RUN/acquire/TerrainNN/photos, whose names are photo keys",
                path=path,
            )
        by_name[path.stem] = path
    return paths


def _in_order(paths: Sequence[Path], work: Callable[[Path], Result], threads: int) -> Iterator[tuple[Path, Result]]:
    """Yield each path with the result of `work`, in input order, with a bounded number of results in memory."""
    with ThreadPoolExecutor(threads) as pool:
        ahead: deque[Future[Result]] = deque()
        later = iter(paths)
        for path in track(paths, "detecting"):
            ahead.extend(pool.submit(work, following) for following in islice(later, 2 * threads - len(ahead)))
            yield path, ahead.popleft().result()


def _grey(pixels: np.ndarray) -> np.ndarray:
    import cv2

    return pixels if pixels.ndim == 2 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))


def _eight_bits(pixels: np.ndarray, depth: np.dtype) -> np.ndarray:
    """Return 8-bit pixels: 8-bit images are brightened if underexposed, 12- and 16-bit images are tone-mapped."""
    if depth == np.uint8:
        return tone.brighten(pixels)
    light = pixels.astype(np.float32)
    if tone.bits_in_use(pixels, depth) == 16:  # black is 0
        light = BLACK_LEVEL + light * ((WHITE_LEVEL - BLACK_LEVEL) / np.iinfo(np.uint16).max)
    return tone.to_8_bits(light)


def _write_jpeg(path: Path, pixels: np.ndarray) -> None:
    import cv2

    content = cv2.imencode(".jpg", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])[1]
    write_bytes(path, content.tobytes())

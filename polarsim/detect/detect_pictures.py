"""Detection of rocks and shadows in external images (`polarsim detect`)."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
from pydantic import ValidationError

from polarsim.detect import detectors, tone
from polarsim.detect.fusion import fuse
from polarsim.detect.grouping import detection_rows
from polarsim.detect.likeness import is_like_polar
from polarsim.detect.masks import class_mask, load_segmenter, within_boxes
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
    groups = [list(weights), list(elsewhere)] if elsewhere else [list(weights)]
    names = [" ".join(path.name for path in group) for group in groups]
    trained = {path: detectors.read_detector(path) for group in groups for path in group}
    has_calibration = all(trained[path].calibration for path in weights)
    unlike: list[str] = []
    rows: list[tuple[object, ...]] = []
    annotated: list[tuple[dict[str, object], list[Annotation]]] = []
    with writing_folder(out) as folder:
        for name in ("labels", *(["masks"] if masks else []), *(["pictures"] if draw else [])):
            (folder / name).mkdir()
        looks = [[_load_look(path, trained[path], folder, options) for path in group] for group in groups]
        segmenters = [[load_segmenter(path, options, _THREADS) for path in group] if masks else [] for group in groups]
        sizes = [widths for group in looks for _, widths in group]
        sizes += [tuple(widths) for group in segmenters for _, widths in group]
        widest = max(max(widths) for widths in sizes)

        def look_at(path: Path) -> tuple[tuple[int, int], np.ndarray, bool] | PolarsimError | OSError:
            """Return width and height of an image, boxes (n, 6) in its pixels, and likeness to POLAR, or the error."""
            try:
                pixels = _grey(read_any(path))
            except (PolarsimError, OSError) as error:
                return error
            size, shown = (pixels.shape[1], pixels.shape[0]), _detector_input(pixels, widest)
            like_polar = is_like_polar(shown)
            number = 0 if like_polar else -1
            parts = [look(shown, size) for look, _ in looks[number]]
            found = fuse(parts, options.nms_iou) if len(parts) > 1 else parts[0]
            found = found[found[:, 4] >= confidence]
            mask = within_boxes(class_mask(segmenters[number], shown, size), found) if masks else None
            if mask is not None:
                class_masks.write_class_mask(folder / "masks" / f"{path.stem}.png", mask)
            if draw:
                kinds = (
                    None if mask is None else {kind: mask == class_masks.CLASSES.index(kind) for kind in BOX_CLASSES}
                )
                drawn = draw(_eight_bits(pixels, pixels.dtype), found, kinds, path.name)
                _write_jpeg(folder / "pictures" / f"{path.stem}.jpg", drawn)
            return size, found, like_polar

        for path, finds in _in_order(paths, look_at, threads):
            if isinstance(finds, Exception):
                reason = finds.reason if isinstance(finds, PolarsimError) else finds.strerror
                log.warning("skipped: %s: %s", path, reason)
                continue
            size, found, like_polar = finds
            calibrated = has_calibration and like_polar
            if has_calibration and not like_polar:
                unlike.append(path.name)
            detector = names[0 if like_polar else -1]
            rows += [(*row, calibrated, detector) for row in detection_rows(path.name, found)]
            yolo.write_boxes(folder / "labels" / f"{path.stem}.txt", found[:, 5], found[:, :4], size, found[:, 4])
            image = {
                "id": len(annotated) + 1, "file_name": relative_to(path, out), "width": size[0], "height": size[1],
                "calibrated": calibrated, "detector": detector,
            }  # fmt: skip
            annotations = [Annotation(BOX_CLASSES[int(r[5])], NO_ROCK, r[:4], confidence=round(r[4], 4)) for r in found]
            annotated.append((image, annotations))
        if not annotated:
            raise DetectError(f"none of {len(paths)} images can be read", path=pictures[0])
        if unlike:
            log.warning(
                "%d of %d images are unlike POLAR's photos (few dark or clipped pixels), so that their confidences are "
                "not calibrated and %s, first %s",
                len(unlike), len(annotated),
                f"{names[-1]} is used" if elsewhere else "most rocks may be missed", unlike[0],
            )  # fmt: skip
        table = pd.DataFrame(rows, columns=list(COLUMNS)).round({"confidence": 4, **dict.fromkeys(COLUMNS[3:7], 1)})
        tables.write_csv(folder / "detections.csv", table)
        coco.write_coco_images(folder / "coco.json", annotated, f"Found by {', '.join(path.name for path in trained)}")
    return table


def _load_look(
    path: Path, detector: detectors.Detector, folder: Path, options: PredictionOptions
) -> tuple[Callable[[np.ndarray, tuple[int, int]], np.ndarray], tuple[int, ...]]:
    """Return the function from an input image and the size of the original image to boxes (n, 6), and its widths."""
    sizes = inference_widths_of(detector, options)
    with with_path(path):
        loaded = detectors.load_detector(detector, folder, options, _THREADS)

    def look(shown: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        (found,) = predict_images(loaded, [shown], sizes, options.nms_iou, size)
        return found

    return look, tuple(sizes.widths)


def prediction_options(
    widths: Sequence[str], gates_px: Sequence[str], device: str, *, mirrored: bool = False, precision: str = "float32"
) -> PredictionOptions:
    """Parse prediction options of the command line."""
    given = {"widths": widths, "gates_px": gates_px, "device": device, "mirrored": mirrored, "precision": precision}
    try:
        return PredictionOptions.model_validate(given | {"confidence": _MIN_CONFIDENCE, "nms_iou": 0.5})
    except ValidationError as error:
        raise DetectError(describe_error(error, "options")) from error


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
            raise DetectError(f"same file name as {by_name[path.stem]}, names must be unique", path=path)
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

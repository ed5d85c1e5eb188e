"""Rocks and shadows in anyone's pictures of ground under low light: what `polarsim detect` does."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
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
from polarsim.detect.masks import LoadedAt, class_mask, mask_widths, within_boxes
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import detect, sizes_of
from polarsim.errors import DetectError, PolarsimError, about
from polarsim.formats import coco, png, tables, yolo
from polarsim.formats.files import relative_to, write_bytes, writing_folder
from polarsim.formats.yaml_files import describe_error
from polarsim.geometry.images import resize_longer_side
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, COLOURS, NO_ROCK, WHITE_LEVEL
from polarsim.progress import track
from polarsim.run_files import class_masks

COLUMNS = ("picture", "kind", "confidence", "x0", "y0", "x1", "y1")
_TINT = 0.4  # weight of a mask's colour in a drawn picture
# A picture as detectors see it, and width and height of the whole one -> boxes (n, 6): x0, y0, x1, y1 in pixels of the
# whole one, confidence, class.
Look = Callable[[np.ndarray, tuple[int, int]], np.ndarray]
Result = TypeVar("Result")
_THREADS = 1  # of torch: pictures are looked at side by side, for one alone does not fill two cores
_LEAST = 0.01  # confidence before calibration
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class _Finds:
    """Width and height of a picture, px, and the boxes (n, 6) that are written, as a `Look` gives them."""

    size: tuple[int, int]
    boxes: np.ndarray


def find_in_pictures(
    *,
    pictures: Sequence[Path],
    weights: Sequence[Path],
    out: Path,
    options: PredictionOptions,
    threads: int,
    confidence: float = 0.25,
    draw: bool = True,
    masks: bool = False,
) -> pd.DataFrame:
    """Write what a detector finds in pictures of any size, 8 or 16 bits, grey or colour; `COLUMNS`, px of the picture.

    Parameters
    ----------
    pictures
        Pictures, and folders of which all pictures are taken. One that cannot be read is named and left out.
    weights
        A detector, or several whose finds are merged: see `fusion.fuse`.
    threads
        So many pictures are looked at at a time, each by one thread: the finds are the same for any number.
    out
        Folder to write: `detections.csv`, `labels/NAME.txt` (YOLO, with the confidence as sixth field), `coco.json`,
        and, where asked, `masks/NAME.png` (what every pixel shows, see `formats.class_masks`; rocks and shadows lie in
        boxes that are written) and `pictures/NAME.jpg` with masks and boxes drawn.
    confidence
        Least confidence of a box that is written; calibrated, where the detector has a calibration.

    Raises
    ------
    PolarsimError
        No picture can be read, two have one name, weights are no detector of ours, or have no masks where these are
        asked for, or `out` exists.
    """
    paths = _listed(pictures)
    if out.exists():
        raise DetectError("is there already: name a new folder", path=out)
    trained = {path: detectors.read_detector(path) for path in weights}
    rows: list[tuple[object, ...]] = []
    annotated: list[tuple[dict[str, object], list[coco.Annotation]]] = []
    with writing_folder(out) as folder:
        for name in ("labels", *(["masks"] if masks else []), *(["pictures"] if draw else [])):
            (folder / name).mkdir()
        looks = [_look(path, detector, folder, options) for path, detector in trained.items()]
        segmenters = [_segmenter(path, detector, options) for path, detector in trained.items()] if masks else []
        widest = max(width for _, widths in [*looks, *segmenters] for width in widths)

        def look_at(path: Path) -> _Finds | PolarsimError | OSError:
            try:
                pixels = _grey(read_any(path))
            except (PolarsimError, OSError) as error:
                return error
            size, shown = (pixels.shape[1], pixels.shape[0]), _as_seen(pixels, widest)
            found = _merged([look(shown, size) for look, _ in looks], options.nms_iou)
            found = found[found[:, 4] >= confidence]
            mask = within_boxes(class_mask(segmenters, shown, size), found) if segmenters else None
            if mask is not None:
                class_masks.write(folder / "masks" / f"{path.stem}.png", mask)
            if draw:
                _draw(folder / "pictures" / f"{path.stem}.jpg", pixels, found, mask)
            return _Finds(size, found)

        for path, finds in _in_order(paths, look_at, threads):
            if not isinstance(finds, _Finds):
                reason = finds.reason if isinstance(finds, PolarsimError) else finds.strerror
                log.warning("left out: %s: %s", path, reason)
                continue
            (width, height), found = finds.size, finds.boxes
            rows += detection_rows(path.name, found)
            yolo.write_boxes(folder / "labels" / f"{path.stem}.txt", found[:, 5], found[:, :4], finds.size, found[:, 4])
            image = {"id": len(annotated) + 1, "file_name": relative_to(path, out), "width": width, "height": height}
            own = [coco.Annotation(BOX_CLASSES[int(r[5])], NO_ROCK, r[:4], confidence=round(r[4], 4)) for r in found]
            annotated.append((image, own))
        if not annotated:
            raise DetectError(f"none of {len(paths)} pictures can be read", path=pictures[0])
        table = pd.DataFrame(rows, columns=list(COLUMNS)).round({"confidence": 4, **dict.fromkeys(COLUMNS[3:], 1)})
        tables.write_csv(folder / "detections.csv", table)
        coco.write_pictures(folder / "coco.json", annotated, f"Found by {', '.join(path.name for path in trained)}")
    return table


def _look(
    path: Path, detector: detectors.Detector, folder: Path, options: PredictionOptions
) -> tuple[Look, tuple[int, ...]]:
    """What a detector of a file sees, and its widths: its own where the options name none."""
    sizes = sizes_of(detector, options)
    with about(path):
        loaded = detectors.load_detector(detector, folder, options, _THREADS)

    def look(shown: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        (found,) = detect(loaded, [shown], sizes, options.nms_iou, size)
        return found

    return look, tuple(sizes.widths)


def _segmenter(path: Path, detector: detectors.Detector, options: PredictionOptions) -> LoadedAt:
    """What makes masks with a detector of a file."""
    with about(path):
        loaded = detectors.load_masks(detector, options, _THREADS)
    return loaded, mask_widths(detector, options)


def _merged(found: Sequence[np.ndarray], nms_iou: float) -> np.ndarray:
    return fuse(found, nms_iou, detectors.MAX_BOXES) if len(found) > 1 else found[0]


def prediction_options(
    widths: Sequence[str], gates_px: Sequence[str], device: str, *, mirrored: bool = False, precision: str = "float32"
) -> PredictionOptions:
    """Options of texts that a person typed.

    Raises
    ------
    DetectError
        One is no number, or they do not go together.
    """
    try:
        return PredictionOptions.model_validate(
            {
                "confidence": _LEAST,
                "nms_iou": 0.5,
                "mirrored": mirrored,
                "precision": precision,
                "widths": widths,
                "gates_px": gates_px,
                "device": device,
            }
        )
    except ValidationError as error:
        raise DetectError(describe_error(error, "options")) from error


def _as_seen(pixels: np.ndarray, longest: int) -> np.ndarray:
    """A picture (h, w[, 3]) of 8 or 16 bits as detectors see it, grey with 8 bits, no longer side above `longest`."""
    grey = _grey(pixels)
    if max(grey.shape) > longest:
        # Light of deeper pictures is averaged before the tone curve.
        grey = resize_longer_side(grey, longest) if grey.dtype == np.uint8 else tone.shrink(grey, longest)
    return _eight_bits(grey, pixels.dtype)


def read_any(path: Path) -> np.ndarray:
    """Return pixels (h, w) or (h, w, 3; RGB order) of 8 or 16 bits, upright as viewers show the image.

    Raises
    ------
    FormatError
        No readable image.
    DetectError
        Another depth.
    """
    pixels = png.read(path)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise DetectError(f"{pixels.dtype}, expected 8 or 16 bits", path=path)
    return pixels


def _listed(pictures: Sequence[Path]) -> list[Path]:
    paths: list[Path] = []
    for path in pictures:
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if file.suffix.lower() in png.SUFFIXES)
            if not inside:
                raise DetectError(f"no picture in it, looked for {', '.join(png.SUFFIXES)}", path=path)
            paths += inside
        elif path.is_file():
            paths.append(path)
        else:
            raise DetectError("no such picture or folder", path=path)
    seen: dict[str, Path] = {}
    for path in paths:
        if path.stem in seen:
            raise DetectError(f"has the name of {seen[path.stem]}, expected each name once", path=path)
        seen[path.stem] = path
    return paths


def _in_order(paths: Sequence[Path], work: Callable[[Path], Result], threads: int) -> Iterator[tuple[Path, Result]]:
    """What is made of each picture, in their order; so many are at work at a time, and no more are done ahead."""
    with ThreadPoolExecutor(threads) as pool:
        ahead: deque[Future[Result]] = deque()
        later = iter(paths)
        for path in track(paths, "detecting"):
            ahead.extend(pool.submit(work, other) for other in islice(later, 2 * threads - len(ahead)))
            yield path, ahead.popleft().result()


def _grey(pixels: np.ndarray) -> np.ndarray:
    import cv2

    return pixels if pixels.ndim == 2 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))


def _eight_bits(pixels: np.ndarray, depth: np.dtype) -> np.ndarray:
    """As detectors see pictures: 8 bits brightened where underexposed, 12 and 16 through the tone curve of training."""
    if depth == np.uint8:
        return tone.brightened(pixels)
    light = pixels.astype(np.float32)
    if tone.bits_in_use(pixels, depth) == 16:  # black is 0
        light = BLACK_LEVEL + light * ((WHITE_LEVEL - BLACK_LEVEL) / np.iinfo(np.uint16).max)
    return tone.to_8_bits(light)


def _draw(path: Path, pixels: np.ndarray, found: Iterable[np.ndarray], mask: np.ndarray | None) -> None:
    import cv2

    canvas = cv2.cvtColor(_eight_bits(pixels, pixels.dtype), cv2.COLOR_GRAY2BGR)
    for kind, colour in COLOURS.items() if mask is not None else ():
        shown = mask == class_masks.CLASSES.index(kind)
        canvas[shown] = ((1 - _TINT) * canvas[shown] + _TINT * np.array(colour[::-1])).astype(np.uint8)
    line = max(1, round(canvas.shape[1] / 700))
    for row in found:
        x0, y0, x1, y1 = np.rint(row[:4]).astype(int).tolist()
        cv2.rectangle(canvas, (x0, y0), (x1, y1), COLOURS[BOX_CLASSES[int(row[5])]][::-1], line)
    write_bytes(path, cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes())

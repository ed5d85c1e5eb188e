"""Evaluation of label files against ground truth: precision, recall, F1 and mean IoU, pooled over files."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from polarsim.errors import FormatError, LabelError
from polarsim.formats import class_lists, release, yolo
from polarsim.formats.files import existing_folder
from polarsim.geometry.boxes import iou, match_by_iou, match_by_summed_iou
from polarsim.photo import BOX_CLASSES, REFERENCE_SIZE_PX, PhotoKey, terrain_text
from polarsim.site import Site, polar

MIN_IOU = 0.5  # minimum IoU of a match
KEY_GROUPS = ("terrain", "position", "light", "azimuth", "camera")

Name = TypeVar("Name", PhotoKey, str)  # name of a label file: a photo key or any text
Content = TypeVar("Content")  # content of a label file

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class PhotoLabels:
    """Boxes of a photo: class numbers (n,) and boxes (n, 4) as x0, y0, x1, y1 in pixels."""

    classes: np.ndarray
    boxes: np.ndarray

    @classmethod
    def none(cls) -> PhotoLabels:
        return cls(np.zeros(0, int), np.zeros((0, 4)))


@dataclass(frozen=True)
class MatchCounts:
    """Sums over files, which can be added."""

    files: int = 0
    tp: int = 0
    fp: int = 0
    fn: int = 0
    iou_sum: float = 0.0  # over true boxes, of the one-to-one assignment with the largest sum

    def __add__(self, other: MatchCounts) -> MatchCounts:
        return MatchCounts(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def metrics(self) -> dict[str, float | int | None]:
        """Return the counts and ratios of the sums; None for a division by zero."""
        truth, labels = self.tp + self.fn, self.tp + self.fp
        return {
            "files": self.files,
            "truth_boxes": truth,
            "label_boxes": labels,
            "tp": self.tp,
            "fp": self.fp,
            "fn": self.fn,
            "precision": _ratio(self.tp, labels),
            "recall": _ratio(self.tp, truth),
            "f1": _ratio(2 * self.tp, truth + labels),
            "miou": _ratio(self.iou_sum, truth),
        }


def count_boxes(truth: np.ndarray, labels: np.ndarray, threshold: float = MIN_IOU) -> MatchCounts:
    """Compare the boxes (n, 4) and (m, 4) of a class in a photo."""
    return count_overlaps(iou(truth, labels), threshold)


def count_overlaps(overlap: np.ndarray, threshold: float = MIN_IOU) -> MatchCounts:
    """Compare n true objects of a class in a photo with m labels by the IoU (n, m).

    Matches are one-to-one, with the maximum number of pairs with IoU >= threshold, then the largest summed IoU. The
    mean IoU uses a separate assignment without threshold.
    """
    truth, labels = overlap.shape
    pairs = len(match_by_iou(overlap, threshold)[0])
    rows, columns = match_by_summed_iou(overlap)
    return MatchCounts(1, pairs, labels - pairs, truth - pairs, float(overlap[rows, columns].sum()))


def count_photo(truth: PhotoLabels, labels: PhotoLabels, threshold: float = MIN_IOU) -> dict[str, MatchCounts]:
    """Compare two sets of labels of a photo for each class."""
    return {
        name: count_boxes(truth.boxes[truth.classes == number], labels.boxes[labels.classes == number], threshold)
        for number, name in enumerate(BOX_CLASSES)
    }


def score_boxes(
    truth: Mapping[Name, PhotoLabels], labels: Mapping[Name, PhotoLabels], threshold: float = MIN_IOU
) -> dict[str, Any]:
    """Return metrics by class for all photos of the truth and, for photo keys, by part of the key.

    All boxes of a photo without labels are missed. Labels of photos without truth are ignored. Result: `classes`: class
    -> metrics; `by`: group -> value -> class -> metrics, see `MatchCounts.metrics`.
    """
    if not 0 < threshold <= 1:
        raise LabelError(f"IoU threshold {threshold:g}, expected more than 0 and at most 1")
    total = {name: MatchCounts() for name in BOX_CLASSES}
    groups: dict[str, dict[str, dict[str, MatchCounts]]] = {group: {} for group in KEY_GROUPS}
    for key in sorted(truth):
        parts = dict(zip(KEY_GROUPS, _key_parts(key), strict=True)) if isinstance(key, PhotoKey) else {}
        for name, counts in count_photo(truth[key], labels.get(key, PhotoLabels.none()), threshold).items():
            total[name] += counts
            for group, value in parts.items():
                groups[group].setdefault(value, {n: MatchCounts() for n in BOX_CLASSES})[name] += counts
    return {
        "threshold": threshold,
        "classes": _metrics(total),
        "by": {
            group: {value: _metrics(part) for value, part in sorted(values.items())} for group, values in groups.items()
        },
    }


def score_folders(
    truth: Path,
    labels: Path,
    threshold: float = MIN_IOU,
    keys: Callable[[PhotoKey], bool] | None = None,
    site: Site | None = None,
) -> dict[str, Any]:
    """Compare two folders of YOLO files: flat, with `TerrainNN` subfolders, or the root of a release.

    Files are matched by photo key, or by file name if no file of the truth has a photo key. `keys` selects the compared
    photos; `site` has these photos (None: NASA's POLAR). The result is that of `score_boxes` with `files`: numbers of
    compared and missing files, and lists of skipped files. Single invalid files of the truth are skipped, because the
    release has such a file.
    """
    key_of = (site or polar()).key
    of_truth, of_labels = _label_files(truth, key_of), _label_files(labels, key_of)
    if not of_truth.files:
        true = {path.stem: path for path in of_truth.stray if path.suffix == ".txt"}
        predicted = {path.stem: path for path in [*of_labels.files.values(), *of_labels.stray] if path.suffix == ".txt"}
        if not true:
            raise LabelError("no label file, such as 01_A_off_180_L_0256.txt or image.txt", path=truth)
        return _score_files(true, predicted, truth, labels, threshold)
    selected = {key: path for key, path in of_truth.files.items() if keys is None or keys(key)}
    report = _score_files(of_truth.files, of_labels.files, truth, labels, threshold, selected)
    strays = {"stray_truth": _names(of_truth.stray, truth), "stray_labels": _names(of_labels.stray, labels)}
    report["files"] |= strays
    return report


def _score_files(
    of_truth: Mapping[Name, Path],
    of_labels: Mapping[Name, Path],
    truth: Path,
    labels: Path,
    threshold: float,
    selected: Mapping[Name, Path] | None = None,
) -> dict[str, Any]:
    """Compare the selected files (default: all) of the truth."""
    if not set(of_truth) & set(of_labels):
        raise LabelError(f"no label file has the same name as a file in {truth}", path=labels)
    selected = of_truth if selected is None else selected
    read_truth, unreadable = read_sound(selected, box_reader(REFERENCE_SIZE_PX))  # IoU does not depend on the size
    read_detections = box_reader(REFERENCE_SIZE_PX, detections=True)
    if unreadable and not read_truth:
        raise FormatError(f"all {len(unreadable)} label files are invalid, first {unreadable[0]}", path=truth)
    read_labels = {name: read_detections(of_labels[name]) for name in read_truth if name in of_labels}
    missing = [name for name in read_truth if name not in read_labels]
    if missing:
        log.warning("%s: %d of %d files are missing, first %s.txt", labels, len(missing), len(selected), missing[0])
    repeated = [name for name, boxes in read_labels.items() if _contains_truth(read_truth[name], boxes)]
    if repeated:
        log.warning(
            "%s: %d of %d files contain exact copies of all boxes of the truth, first %s.txt: are seeds evaluated "
            "against themselves?",
            labels, len(repeated), len(read_labels), repeated[0],
        )  # fmt: skip
    files = {
        "compared": len(read_truth), "missing_labels": len(missing), "unreadable_truth": unreadable,
        "not_selected": len(of_truth) - len(selected), "labels_without_truth": len(set(of_labels) - set(of_truth)),
        "stray_truth": [], "stray_labels": [],
    }  # fmt: skip
    return {**score_boxes(read_truth, read_labels, threshold), "files": files}


def _contains_truth(truth: PhotoLabels, labels: PhotoLabels) -> bool:
    """Return whether every true box is exactly equal to a label, as for copied boxes."""
    copied = {(number, *box) for number, box in zip(labels.classes.tolist(), labels.boxes.tolist(), strict=True)}
    true = [(number, *box) for number, box in zip(truth.classes.tolist(), truth.boxes.tolist(), strict=True)]
    return bool(true) and all(row in copied for row in true)


def box_reader(size: tuple[int, int], detections: bool = False) -> Callable[[Path], PhotoLabels]:
    """Return a reader of YOLO box files of photos of a size, px, that uses the class list of the folder.

    The reader raises a FormatError for a line that is not a box. With `detections`, a line may have a confidence, and
    polygons of a run are replaced by the boxes around them.
    """
    names = cache(class_lists.class_names)

    def read(path: Path) -> PhotoLabels:
        if detections and yolo.has_polygons(path):
            return PhotoLabels(*yolo.read_boxes_or_polygons(path, size))
        return PhotoLabels(*yolo.read_boxes(path, size, names(path.parent), detections))

    return read


def read_sound(files: Mapping[Name, Path], reader: Callable[[Path], Content]) -> tuple[dict[Name, Content], list[str]]:
    """Return the contents of the valid files, and the errors of the invalid files, which are also logged."""
    contents: dict[Name, Content] = {}
    unreadable = []
    for key, path in files.items():
        try:
            contents[key] = reader(path)
        except FormatError as error:
            log.warning("excluded from the evaluation: %s", error)
            unreadable.append(f"{path.name}: {FormatError(error.reason, line=error.line)}")
    return contents, unreadable


def _label_files(folder: Path, key_of: release.KeyOf) -> release.KeyFiles:
    return release.key_files(release.box_folder(existing_folder(folder)), key_of)


def _names(paths: list[Path], folder: Path) -> list[str]:
    release.log_strays(paths, str(folder))
    return [path.relative_to(folder).as_posix() for path in paths]


def _key_parts(key: PhotoKey) -> tuple[str, ...]:
    """Return the values of `KEY_GROUPS`."""
    return terrain_text(key.terrain), key.position, key.light, key.azimuth, key.camera


def _metrics(parts: Mapping[str, MatchCounts]) -> dict[str, dict[str, float | int | None]]:
    return {name: counts.metrics() for name, counts in parts.items()}


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole else None

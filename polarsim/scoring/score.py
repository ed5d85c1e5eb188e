"""How well label files agree with hand-annotated or true ones: precision, recall, F1, mean IoU, pooled over files."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from polarsim.errors import FormatError, LabelError
from polarsim.formats import release, yolo
from polarsim.formats.files import existing_folder
from polarsim.geometry.boxes import iou, match, match_sum
from polarsim.photo import BOX_CLASSES, PhotoKey

GROUPS: dict[str, Callable[[PhotoKey], str]] = {
    "terrain": lambda key: f"{key.terrain:02d}",
    "position": lambda key: key.position,
    "light": lambda key: key.light,
    "azimuth": lambda key: key.azimuth,
    "camera": lambda key: key.camera,
}

Name = TypeVar("Name", PhotoKey, str)  # what a label file is called: POLAR's way, or anyone's
Content = TypeVar("Content")  # of a label file

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Labels:
    """The boxes of one photo: class numbers (n,) and boxes (n, 4) as x0, y0, x1, y1 in pixels."""

    classes: np.ndarray
    boxes: np.ndarray

    @classmethod
    def none(cls) -> Labels:
        return cls(np.zeros(0, int), np.zeros((0, 4)))


@dataclass(frozen=True)
class Counts:
    """Sums over files; they add up."""

    files: int = 0
    tp: int = 0
    fp: int = 0
    fn: int = 0
    iou_sum: float = 0.0  # over truth boxes, of the one-to-one assignment with the largest sum

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(one + more for one, more in zip(astuple(self), astuple(other), strict=True)))

    def metrics(self) -> dict[str, float | int | None]:
        """Ratios of the sums; None where the divisor is 0."""
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


def count_boxes(truth: np.ndarray, labels: np.ndarray, threshold: float = 0.5) -> Counts:
    """Compare the boxes (n, 4) and (m, 4) of one class on one photo."""
    return count_overlaps(iou(truth, labels), threshold)


def count_overlaps(overlap: np.ndarray, threshold: float = 0.5) -> Counts:
    """Compare the n true objects of one class on one photo with m labels by their IoU (n, m).

    Pairs are one-to-one: as many as can be with IoU >= threshold, then of the largest summed IoU. The mean IoU has an
    assignment of its own, without threshold.
    """
    truth, labels = overlap.shape
    pairs = len(match(overlap, threshold)[0])
    rows, columns = match_sum(overlap)
    return Counts(1, pairs, labels - pairs, truth - pairs, float(overlap[rows, columns].sum()))


def count_photo(truth: Labels, labels: Labels, threshold: float = 0.5) -> dict[str, Counts]:
    """Compare two sets of labels of one photo, class by class."""
    return {
        name: count_boxes(truth.boxes[truth.classes == number], labels.boxes[labels.classes == number], threshold)
        for number, name in enumerate(BOX_CLASSES)
    }


def score(truth: Mapping[Name, Labels], labels: Mapping[Name, Labels], threshold: float = 0.5) -> dict[str, Any]:
    """Metrics by class, over all photos of the truth and, where they have photo keys, by part of the key.

    A photo of the truth without labels has all its boxes missed; labels of photos without truth are not looked at.

    Returns
    -------
    dict
        `classes`: class -> metrics; `by`: group -> value -> class -> metrics. Metrics are those of `Counts.metrics`.
    """
    if not 0 < threshold <= 1:
        raise LabelError(f"IoU threshold {threshold:g}, expected more than 0 and at most 1")
    total = {name: Counts() for name in BOX_CLASSES}
    groups: dict[str, dict[str, dict[str, Counts]]] = {group: {} for group in GROUPS}
    for key in sorted(truth):
        for name, counts in count_photo(truth[key], labels.get(key, Labels.none()), threshold).items():
            total[name] += counts
            for group, value in _parts_of(key).items():
                part = groups[group].setdefault(value, {n: Counts() for n in BOX_CLASSES})
                part[name] += counts
    return {
        "threshold": threshold,
        "classes": _metrics(total),
        "by": {
            group: {value: _metrics(part) for value, part in sorted(values.items())} for group, values in groups.items()
        },
    }


def score_folders(
    truth: Path, labels: Path, threshold: float = 0.5, keys: Callable[[PhotoKey], bool] | None = None
) -> dict[str, Any]:
    """Compare two folders of YOLO files, each flat, with `TerrainNN` subfolders, or a release's root.

    Files are paired by photo key, which strays have none of; where the truth has no photo keys at all, by name.

    Parameters
    ----------
    keys
        Which photos are compared; all of the truth's when None.

    Returns
    -------
    dict
        That of `score`, and `files`: how many were compared, were missing, were left out and why.

    Raises
    ------
    FormatError
        A folder is missing, a label file is broken, or all truth files are. A broken truth file among sound ones is
        left out and listed: it is nobody's labels that are wrong there, and the release has one.
    LabelError
        A photo has two label files in one folder, the truth has no label file at all, or none of the labels' names.
    """
    of_truth, of_labels = _label_files(truth), _label_files(labels)
    if not of_truth.files:
        return _score_by_name(of_truth.stray, of_labels, truth, labels, threshold)
    if not set(of_truth.files) & set(of_labels.files):
        raise LabelError(f"no label file of a photo that {truth} has", path=labels)
    wanted = {key: path for key, path in of_truth.files.items() if keys is None or keys(key)}
    report = _score_files(wanted, of_labels.files, truth, labels, threshold)
    report["files"] |= {
        "not_selected": len(of_truth.files) - len(wanted),
        "labels_without_truth": len([key for key in of_labels.files if key not in of_truth.files]),
        "stray_truth": _names(of_truth.stray, truth),
        "stray_labels": _names(of_labels.stray, labels),
    }
    return report


def _score_by_name(
    of_truth: list[Path], of_labels: release.KeyFiles, truth: Path, labels: Path, threshold: float
) -> dict[str, Any]:
    """Of flat folders whose files are not named by photo keys."""
    true = {path.stem: path for path in of_truth if path.suffix == ".txt"}
    found = {path.stem: path for path in [*of_labels.files.values(), *of_labels.stray] if path.suffix == ".txt"}
    if not true:
        raise LabelError("no label file, such as 01_A_off_180_L_0256.txt or picture.txt", path=truth)
    if not set(true) & set(found):
        raise LabelError(f"no label file of the same name as one of {truth}", path=labels)
    report = _score_files(true, found, truth, labels, threshold)
    report["files"] |= {
        "not_selected": 0,
        "labels_without_truth": len(set(found) - set(true)),
        "stray_truth": [],
        "stray_labels": [],
    }
    return report


def _score_files(
    of_truth: Mapping[Name, Path], of_labels: Mapping[Name, Path], truth: Path, labels: Path, threshold: float
) -> dict[str, Any]:
    read_truth, unreadable = read_sound(of_truth, box_reader())
    read_found = box_reader(detections=True)
    if unreadable and not read_truth:
        raise FormatError(f"none of {len(unreadable)} label files can be read, first {unreadable[0]}", path=truth)
    read_labels = {name: read_found(of_labels[name]) for name in read_truth if name in of_labels}
    missing = [name for name in read_truth if name not in read_labels]
    if missing:
        log.warning("%s: %d of %d files are missing, first %s.txt", labels, len(missing), len(of_truth), missing[0])
    repeated = [name for name, own in read_labels.items() if _repeats(read_truth[name], own)]
    if repeated:
        log.warning(
            "%s: %d of %d files repeat every box of their truth file, first %s.txt: seeds scored against themselves?",
            labels, len(repeated), len(read_labels), repeated[0],
        )  # fmt: skip
    files = {"compared": len(read_truth), "missing_labels": len(missing), "unreadable_truth": unreadable}
    return {**score(read_truth, read_labels, threshold), "files": files}


def _repeats(truth: Labels, labels: Labels) -> bool:
    """Whether every true box is among the labels to the last digit, as boxes that were copied are."""
    copied = {(number, *box) for number, box in zip(labels.classes.tolist(), labels.boxes.tolist(), strict=True)}
    own = [(number, *box) for number, box in zip(truth.classes.tolist(), truth.boxes.tolist(), strict=True)]
    return bool(own) and all(row in copied for row in own)


def _parts_of(name: PhotoKey | str) -> dict[str, str]:
    """By group: the part that a photo belongs to."""
    return {group: value_of(name) for group, value_of in GROUPS.items()} if isinstance(name, PhotoKey) else {}


def box_reader(detections: bool = False) -> Callable[[Path], Labels]:
    """Return a reader of YOLO box files whose class numbers mean what the class list of their folder states.

    The reader raises a FormatError for a line that is no box. With `detections` a line may have a confidence, and a
    file of a run's polygons counts as the boxes around them.
    """
    names = cache(yolo.class_names)

    def read(path: Path) -> Labels:
        if detections and yolo.has_polygons(path):
            return Labels(*yolo.read_boxes_or_polygons(path))
        return Labels(*yolo.read_boxes(path, names=names(path.parent), detections=detections))

    return read


def read_sound(files: Mapping[Name, Path], reader: Callable[[Path], Content]) -> tuple[dict[Name, Content], list[str]]:
    """What the files hold, and what is wrong with those that are broken, which a warning names too."""
    found: dict[Name, Content] = {}
    unreadable = []
    for key, path in files.items():
        try:
            found[key] = reader(path)
        except FormatError as error:
            log.warning("left out of the scores: %s", error)
            unreadable.append(f"{path.name}: {FormatError(error.reason, line=error.line)}")
    return found, unreadable


def _label_files(folder: Path) -> release.KeyFiles:
    return release.key_files(release.box_folder(existing_folder(folder)))


def _names(paths: list[Path], folder: Path) -> list[str]:
    release.log_strays(paths, str(folder))
    return [path.relative_to(folder).as_posix() for path in paths]


def _metrics(parts: Mapping[str, Counts]) -> dict[str, dict[str, float | int | None]]:
    return {name: counts.metrics() for name, counts in parts.items()}


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole else None

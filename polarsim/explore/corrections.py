"""Corrections of a run: boxes that were corrected in the page, a label file per photo, and the next run with them."""

from __future__ import annotations

import hashlib
import threading
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import LabelError
from polarsim.explore.next_run import write_overlay
from polarsim.explore.tables import EDGES
from polarsim.formats import class_lists, yolo
from polarsim.formats.coco import read_coco
from polarsim.formats.release import key_files
from polarsim.labels.seeds import AnnotatedBoxes, matched_rocks, read_corrections
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey
from polarsim.run_files.run import PHOTO, Run

END_S = 10.0  # maximum time that a change in progress has to end, if the disk does not respond
MIN_SIDE_PX = 0.01  # minimum side of a box; label files have 6 decimals, relative to the width of the photo

Boxes = list[dict[str, Any]]  # kind, rock, x0, y0, x1, y1 in pixels, as in the page


class Corrections:
    """The folder `corrections` of a run, which `labels.corrections` reads."""

    def __init__(self, run: Run) -> None:
        self.folder = run.folder / "corrections"
        self._run = run
        self._size = run.site.images.size
        self._keys = {str(key): key for _, key in run.pictures}
        self._lock = threading.Lock()  # each request has a thread

    def __contains__(self, name: str) -> bool:
        """Return whether a text is the key of a photo of the run."""
        return name in self._keys

    def read(self) -> dict[str, Boxes]:
        """Return all boxes of each corrected photo by key.

        Rock ids are from the matched labels of the run, as in propagation.
        """
        if not self.folder.is_dir():
            return {}
        with self._lock:
            corrected: dict[PhotoKey, AnnotatedBoxes] = {}
            for terrain in self._run.terrains:
                corrected |= read_corrections(self.folder, self._run.site, terrain)
        return {str(key): self._with_rocks(key, annotated) for key, annotated in sorted(corrected.items())}

    def save(self, name: str, boxes: object) -> Path:
        """Replace all boxes of a photo and return the written file.

        An empty list of boxes states that the photo shows neither rocks nor shadows. Invalid boxes, and a photo that is
        corrected in a COCO file, raise a LabelError.
        """
        kinds, corners = _checked(boxes, *self._size)
        with self._lock:
            path = self._file_of(self._keys[name])
            names = class_lists.class_names(path.parent)
            if missing := sorted(set(kinds) - set(names)):
                raise LabelError(f"{', '.join(missing)} is missing", path=path.parent / class_lists.CLASS_FILE)
            yolo.write_boxes(path, np.array([names.index(kind) for kind in kinds], int), corners, self._size)
        return path

    def drop(self, name: str) -> None:
        """Remove the correction of a photo, so that the photo is labelled as propagated.

        A photo that is corrected in a COCO file raises a LabelError.
        """
        with self._lock:
            self._file_of(self._keys[name]).unlink(missing_ok=True)

    def version(self) -> str:
        """Return a digest of all files in the folder, by which the page recognises changes by other programs."""
        digest = hashlib.sha256()
        for path in sorted(self.folder.rglob("*")):
            if path.is_file():
                digest.update(f"{path.relative_to(self.folder)}\0{path.stat().st_size}\0".encode() + path.read_bytes())
        return digest.hexdigest()[:16]

    def prepare_run(self) -> dict[str, str]:
        """Write the overlay of the next run, see `write_overlay`."""
        with self._lock:
            return write_overlay(self._run, self.folder)

    def labels_version(self) -> tuple[int, ...]:
        """Return a value that changes when a run writes new label tables."""
        return tuple(path.stat().st_mtime_ns for path in sorted(self._run.folder.glob("labels/*/*.parquet")))

    def finish(self) -> None:
        """Wait for a change in progress and block further changes, before the process ends with all threads."""
        self._lock.acquire(timeout=END_S)

    def _file_of(self, key: PhotoKey) -> Path:
        for path in sorted(self.folder.rglob("*.json")):
            if key in read_coco(path, self._size, self._run.site.key_of_picture):
                raise LabelError(f"{key} is corrected here: edit or remove this file first", path=path)
        return key_files(self.folder).files.get(key, self.folder / f"{key}.txt")

    def _with_rocks(self, key: PhotoKey, annotated: AnnotatedBoxes) -> Boxes:
        labels = self._run.labels(key.terrain, of_twins=not self._has_photo(key))
        labels = labels[labels["key"] == str(key)]
        result: Boxes = []
        for kind, boxes in ((ROCK, annotated.rocks), (SHADOW, annotated.shadows)):
            of_kind = labels[labels["kind"] == kind]
            boxes = np.zeros((0, 4)) if boxes is None else boxes
            rocks = matched_rocks(boxes, of_kind[EDGES].to_numpy(float), of_kind["rock"].to_numpy(int))
            for rock, corners in zip(rocks, boxes.round(3), strict=True):
                result.append({"kind": kind, "rock": int(rock), **dict(zip(EDGES, map(float, corners), strict=True))})
        return result

    def _has_photo(self, key: PhotoKey) -> bool:
        return (PHOTO, key) in self._run.pictures


def _checked(boxes: object, width: int, height: int) -> tuple[list[str], np.ndarray]:
    """Return kinds and corners (n, 4), px, of boxes as a page sends them, inside a photo of a width and height."""
    if not isinstance(boxes, list):
        raise LabelError("expected a list of boxes")
    kinds, corners = [], []
    for number, box in enumerate(boxes, 1):
        if not isinstance(box, dict) or box.get("kind") not in BOX_CLASSES:
            raise LabelError(f"box {number}: expected an object with kind {' or '.join(BOX_CLASSES)}")
        for edge, maximum in {"x0": width, "x1": width, "y0": height, "y1": height}.items():
            value = box.get(edge)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= maximum:
                raise LabelError(f"box {number}: {edge} is {value!r:.40}, expected a number from 0 to {maximum}")
        x0, y0, x1, y1 = (float(box[edge]) for edge in EDGES)
        if min(x1 - x0, y1 - y0) < MIN_SIDE_PX:
            raise LabelError(f"box {number} has no area: expected x0 < x1 and y0 < y1")
        kinds.append(str(box["kind"]))
        corners.append((x0, y0, x1, y1))
    return kinds, np.array(corners, float).reshape(-1, 4)

"""Folders as YOLO trainers have them: `images/.../NAME.png` beside `labels/.../NAME.txt`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import yolo
from polarsim.lint.boxes import Size, box_defects
from polarsim.lint.findings import Findings, Report
from polarsim.lint.rules import Defect
from polarsim.progress import track

IMAGES, LABELS = "images", "labels"
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
_CLASS_LIST = "classes.txt"


def is_picture_folder(root: Path) -> bool:
    return (root / IMAGES).is_dir() and (root / LABELS).is_dir()


def lint_pictures(root: Path) -> Report:
    """Look at every label file beside its picture, whose size counts.

    Raises
    ------
    FormatError
        There is no label file.
    """
    pictures = {_stem(path, root / IMAGES): path for path in _files(root / IMAGES, SUFFIXES)}
    labels = {_stem(path, root / LABELS): path for path in _files(root / LABELS, (".txt",))}
    if not labels:
        raise FormatError("no label file (*.txt)", path=root / LABELS)
    found = Findings(root)
    boxes = 0
    for stem in sorted(set(pictures) - set(labels)):
        found.add(pictures[stem], Defect("missing_labels"))
    for stem, path in track(sorted(labels.items()), "validating labels"):
        if stem not in pictures:
            found.add(path, Defect("missing_picture"))
            continue
        size = found.read(pictures[stem], _size, "unreadable_picture")
        content = found.read(path, partial(yolo.read_boxes, size=size), "malformed") if size else None
        if content is not None and size is not None:
            boxes += len(content[0])
            for defect in box_defects(*content, size):
                found.add(path, defect)
    return Report(
        sorted(found.gathered), {"folder": {"pictures": len(pictures), "label_files": len(labels), "boxes": boxes}}
    )


def _files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in suffixes and path.name != _CLASS_LIST)


def _stem(path: Path, folder: Path) -> str:
    return path.relative_to(folder).with_suffix("").as_posix()


def _size(path: Path) -> Size:
    """Width and height of a picture."""
    import cv2

    content = np.frombuffer(path.read_bytes(), np.uint8)
    picture = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if len(content) else None
    if picture is None:
        raise FormatError("no picture", path=path)
    return picture.shape[1], picture.shape[0]

"""Labels from the exports of other tools as a folder of label files that a run starts from.

The steps: `export_files` finds the files and the tool, a reader (`cvat`, `label_studio`, `fiftyone`, here COCO and
YOLO) returns the shapes of each picture, and `import_labels` writes boxes around the shapes and counts the rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from polarsim.annotate.cvat import read_cvat
from polarsim.annotate.export_files import (
    COCO,
    CVAT,
    FIFTYONE,
    FORMS,
    LABEL_STUDIO,
    YOLO,
    find_files,
    label_files,
    unpacked,
)
from polarsim.annotate.fiftyone import read_fiftyone
from polarsim.annotate.label_studio import is_predicted, read_label_studio
from polarsim.annotate.shapes import SIZE, Picture, Shape, scale_of
from polarsim.errors import ConfigError, FormatError
from polarsim.formats import coco, yolo
from polarsim.formats.files import check_new_folder, writing_folder
from polarsim.formats.readers import reader, reading
from polarsim.geometry.boxes import clip
from polarsim.photo import BOX_CLASSES, PhotoKey

AUTO = "auto"
STRAY = "text file without a photo key"
_LEAST_PX = 1e-3  # shortest side of a box inside the photo
_CUT_PX = 0.5  # a box that reaches farther over the border is reported
_EXAMPLES = 3  # photos that a message names


@dataclass
class Imported:
    """What an import wrote, and what it did not use."""

    photos: int = 0  # label files
    boxes: int = 0
    read: Counter[str] = field(default_factory=Counter)  # shapes that became boxes, by form
    skipped: Counter[str] = field(default_factory=Counter)  # shapes and files that did not, by form
    named_out: Counter[str] = field(default_factory=Counter)  # shapes that an empty name leaves out, by name
    cut: int = 0  # boxes that reached over the photo's border
    empty: list[str] = field(default_factory=list)  # photos without a shape that were left out
    unread: list[str] = field(default_factory=list)  # photos with nothing but skipped shapes, left out
    notes: list[str] = field(default_factory=list)  # where the classes came from, and the like

    def report(self) -> list[str]:
        """Return lines about everything but the label files; the last one counts what was read and skipped."""
        lines = list(self.notes)
        if self.cut:
            lines.append(f"{self.cut} boxes were cut at the photo's border")
        if self.empty:
            lines.append(
                f"{len(self.empty)} photos without a box were left out (--keep-empty takes them as seen): "
                f"{_some(self.empty)}"
            )
        if self.unread:
            lines.append(f"{len(self.unread)} photos with skipped shapes only were left out: {_some(self.unread)}")
        if self.named_out:
            lines.append(f"left out by --name: {_counts(self.named_out)}")
        return [*lines, f"read: {_counts(self.read)}; skipped: {_counts(self.skipped)}"]


def _some(names: list[str]) -> str:
    return ", ".join(names[:_EXAMPLES]) + (", ..." if len(names) > _EXAMPLES else "")


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{form} ({count})" for form, count in sorted(counts.items())) or "nothing"


@reader("export of labels", largest_mb=500)
def import_labels(
    source: Path,
    folder: Path,
    form: str = AUTO,
    names: Mapping[str, str] | None = None,
    keep_empty: bool = False,
) -> Imported:
    """Write `KEY.txt` of every photo that was labelled, with the boxes around everything that was drawn.

    Parameters
    ----------
    source
        A file, a folder or a zip archive.
    folder
        A new folder, or an empty one.
    form
        One of `READERS`, or `AUTO`: that of the files.
    names
        Other names of a rock or shadow in the export, such as boulder -> rock; an empty word leaves the shape out.
    keep_empty
        Write an empty file for a photo without a shape: a person saw nothing. Else the photo is left out, since tools
        export pictures that nobody opened as well. Photos with skipped shapes only are left out in any case.

    Raises
    ------
    ConfigError
        The folder has files, or no such form.
    FormatError
        The source has no known form, names no photo, or holds classes other than rock and shadow or implausible boxes.
    """
    check_new_folder(folder)
    if form not in (AUTO, *READERS):
        raise ConfigError(f"format {form!r}, expected {', '.join(READERS)} or {AUTO}")
    done = Imported()
    photos: dict[PhotoKey, list[tuple[int, np.ndarray]]] = {}
    named: dict[PhotoKey, str] = {}
    with unpacked(source) as opened:
        form, files = find_files(opened, None if form == AUTO else form)
        for file in files:
            with reading(f"export of {form}", file):
                for picture in READERS[form](file, done):
                    key = coco.key_of_picture(file, picture.name)
                    if key in named:
                        raise FormatError(
                            f"{key} is there twice, as {named[key]} and {picture.name}: keep one", path=file
                        )
                    named[key] = picture.name
                    boxes = _classified(file, picture, names or {}, done)
                    if not boxes and any(shape.box is None for shape in picture.shapes):
                        done.unread.append(str(key))
                    else:
                        photos[key] = boxes
        done.notes = [note.replace(str(opened), str(source)) for note in done.notes]
    empty = [str(key) for key, boxes in photos.items() if not boxes]
    kept = {key: boxes for key, boxes in sorted(photos.items()) if boxes or keep_empty}
    if not kept:
        raise FormatError(f"no labelled photo; skipped: {_counts(done.skipped)}", path=source)
    with writing_folder(folder) as temporary:
        for key, boxes in kept.items():
            classes = np.array([number for number, _ in boxes], int)
            yolo.write_boxes(temporary / f"{key}.txt", classes, np.array([box for _, box in boxes]).reshape(-1, 4))
    done.photos, done.boxes = len(kept), sum(map(len, kept.values()))
    done.empty, done.unread = [] if keep_empty else sorted(empty), sorted(done.unread)
    return done


def _classified(file: Path, picture: Picture, names: Mapping[str, str], done: Imported) -> list[tuple[int, np.ndarray]]:
    """Class number and box of each shape, cut at the photo's border; counts what is read and what is not."""
    boxes = []
    for shape in picture.shapes:
        if shape.box is None:
            done.skipped[shape.form] += 1
            continue
        kind = names.get(shape.label, shape.label.strip().lower())
        if not kind:
            if not shape.label:
                raise FormatError(f"{picture.name}, {shape.where}: without a class", path=file)
            done.named_out[shape.label] += 1
            continue
        if kind not in BOX_CLASSES:
            raise FormatError(
                f"{picture.name}, {shape.where}: {shape.label!r} is neither {' nor '.join(BOX_CLASSES)}: "
                f"--name '{shape.label}=rock', or --name '{shape.label}=' leaves it out",
                path=file,
            )
        _check(file, f"{picture.name}, {shape.where}", kind, shape.box)
        cut = clip(shape.box)
        done.cut += bool(np.abs(cut - shape.box).max() > _CUT_PX)
        done.read[shape.form] += 1
        boxes.append((BOX_CLASSES.index(kind), cut))
    return boxes


def _check(file: Path, where: str, kind: str, box: np.ndarray) -> None:
    """Refuse a box (4,), px, that nobody can have drawn."""
    cut = clip(box)
    if not np.isfinite(box).all() or (cut[2:] - cut[:2] < _LEAST_PX).any():
        raise FormatError(f"{where}: a {kind} without area inside the photo, {box.round(2).tolist()}", path=file)
    if box.max() <= 1:
        raise FormatError(f"{where}: {box.tolist()}, expected pixels: are these shares of the picture?", path=file)
    if (box[:2] < -coco.MAX_OVERHANG * SIZE).any() or (box[2:] > (1 + coco.MAX_OVERHANG) * SIZE).any():
        raise FormatError(f"{where}: a {kind} far over the photo's border, {box.round(1).tolist()}", path=file)


def _coco(source: Path, _: Imported) -> Iterator[Picture]:
    for name, size, rows in coco.read_pictures(source):
        scale = scale_of(source, name, *size) if rows else 1.0
        yield Picture(
            name, [Shape(row.where, row.form, row.annotation.kind, row.annotation.box * scale) for row in rows]
        )


def _yolo(source: Path, done: Imported) -> Iterator[Picture]:
    """Read every `KEY.txt` below a folder."""
    keys, others = label_files(source)
    lists: dict[Path, yolo.ClassList] = {}
    for path in keys:
        if path.parent not in lists:
            lists[path.parent] = yolo.find_classes(path.parent, source)
        classes = lists[path.parent]
        shapes = []
        for line in yolo.read_shapes(path):
            number = yolo.class_number(path, line)
            if number >= len(classes.names) or not classes.names[number]:
                stated = f"{classes.path} has {classes}" if classes.path else f"no class list found, assumed {classes}"
                raise FormatError(f"class {number}: {stated}", path=path, line=line.line)
            form = "polygon" if line.is_polygon else "box" if line.confidence is None else "detection"
            shapes.append(Shape(f"{path.name}:{line.line}", form, classes.names[number], line.box))
        yield Picture(path.name, shapes)
    for classes in dict.fromkeys(lists.values()):
        origin = f"classes from {classes.path}:" if classes.path else "no class list found: assuming"
        done.notes.append(f"{origin} {classes}")
    strays = [path for path in others if not yolo.is_class_list(path)]
    if strays:
        done.skipped[STRAY] += len(strays)
        done.notes.append(f"text files without a photo key: {_some([path.name for path in strays])}")


def _label_studio(source: Path, done: Imported) -> Iterator[Picture]:
    yield from read_label_studio(source)
    if is_predicted(source):
        done.notes.append("no task has an annotation: the labels are predictions, which nobody corrected")


READERS: dict[str, Callable[[Path, Imported], Iterator[Picture]]] = {
    COCO: _coco,
    YOLO: _yolo,
    CVAT: lambda source, _: read_cvat(source),
    LABEL_STUDIO: _label_studio,
    FIFTYONE: lambda source, _: read_fiftyone(source),
}
assert tuple(READERS) == FORMS

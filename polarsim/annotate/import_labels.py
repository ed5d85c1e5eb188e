"""Import of labels from annotation tools into a folder of label files for a run.

`export_files` finds the files and the format. A reader (`cvat`, `label_studio`, COCO and YOLO in this module) returns
the shapes of each image. `import_labels` writes the bounding boxes and counts skipped shapes.
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
    EXPORT_FORMS,
    LABEL_STUDIO,
    OTHER_SITE,
    YOLO,
    ExportedImage,
    ExportedShape,
    find_files,
    keyed_label_files,
    scale_of,
    unpacked,
)
from polarsim.annotate.label_studio import is_predicted, read_label_studio
from polarsim.errors import ConfigError, FormatError, with_part
from polarsim.formats import class_lists, coco, yolo
from polarsim.formats.coco_annotations import MAX_OVERHANG
from polarsim.formats.files import check_new_folder, writing_folder
from polarsim.formats.readers import reader, reading
from polarsim.geometry.boxes import clip
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.site import Site

AUTO = "auto"
STRAY = "text file without a photo key"
_MIN_SIDE_PX = 1e-3  # minimum side of a box inside the photo
_MAX_CUT_PX = 0.5  # maximum overhang of a box over the image border that is not reported
_EXAMPLES = 3  # maximum number of photos in a message


@dataclass
class Imported:
    """Counts of imported and skipped labels."""

    photos: int = 0  # label files
    boxes: int = 0
    read: Counter[str] = field(default_factory=Counter)  # imported shapes by form
    skipped: Counter[str] = field(default_factory=Counter)  # skipped shapes and files by form
    named_out: Counter[str] = field(default_factory=Counter)  # shapes excluded by an empty name, by class
    classes: set[str] = field(default_factory=set)  # names in the export
    cut: int = 0  # clipped boxes
    empty: list[str] = field(default_factory=list)  # skipped photos without a shape
    unread: list[str] = field(default_factory=list)  # skipped photos in which all shapes were skipped
    notes: list[str] = field(default_factory=list)  # origin of the class names and similar remarks

    def report(self) -> list[str]:
        """Return lines about clipped and skipped labels; the last line counts read and skipped shapes."""
        lines = list(self.notes)
        if self.cut:
            lines.append(f"{self.cut} boxes were clipped to the photo")
        if self.empty:
            lines.append(
                f"{len(self.empty)} photos without a box were skipped (--keep-empty imports empty photos): "
                f"{_some(self.empty)}"
            )
        if self.unread:
            lines.append(f"{len(self.unread)} photos with skipped shapes only were skipped: {_some(self.unread)}")
        if self.named_out:
            lines.append(f"excluded by --name: {_counts(self.named_out)}")
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
    *,
    site: Site,
) -> Imported:
    """Write `KEY.txt` of every labelled photo with the bounding boxes of all shapes.

    Parameters
    ----------
    source
        A file, a folder or a zip archive.
    names
        Other names of rocks and shadows in the export, such as boulder -> rock; an empty text excludes the class.
    site
        Site of the photos, which determines their keys and size.
    keep_empty
        Write an empty file for photos without a shape. By default they are skipped, because annotation tools also
        export images that were never opened. Photos in which all shapes were skipped are always skipped.
    """
    check_new_folder(folder)
    if form not in (AUTO, *IMPORTERS):
        raise ConfigError(f"format {form!r}, expected {', '.join(IMPORTERS)} or {AUTO}")
    done = Imported()
    photos: dict[PhotoKey, list[tuple[int, np.ndarray]]] = {}
    named: dict[PhotoKey, str] = {}
    with unpacked(source) as opened:
        form, files = find_files(opened, site, None if form == AUTO else form)
        for file in files:
            with reading(f"export of {form}", file):
                for picture in IMPORTERS[form](file, site, done):
                    key = _key(file, picture.name, site)
                    if key in named:
                        raise FormatError(f"{key} has two images, {named[key]} and {picture.name}: remove an image")
                    named[key] = picture.name
                    with with_part(picture.name):
                        boxes = _classified(picture, names or {}, site.images.size, done)
                    if not boxes and any(shape.box is None for shape in picture.shapes):
                        done.unread.append(str(key))
                    else:
                        photos[key] = boxes
        if unused := sorted(set(names or {}) - done.classes):
            found = ", ".join(sorted(done.classes)) or "none"
            done.notes.append(f"--name: no shape has the class {', '.join(unused)}; classes of the shapes: {found}")
        done.notes = [note.replace(str(opened), str(source)) for note in done.notes]
    empty = [str(key) for key, boxes in photos.items() if not boxes]
    kept = {key: boxes for key, boxes in sorted(photos.items()) if boxes or keep_empty}
    if not kept:
        raise FormatError(f"no labelled photo; skipped: {_counts(done.skipped)}", path=source)
    with writing_folder(folder) as temporary:
        for key, boxes in kept.items():
            classes = np.array([number for number, _ in boxes], int)
            corners = np.array([box for _, box in boxes]).reshape(-1, 4)
            yolo.write_boxes(temporary / f"{key}.txt", classes, corners, site.images.size)
    done.photos, done.boxes = len(kept), sum(map(len, kept.values()))
    done.empty, done.unread = [] if keep_empty else sorted(empty), sorted(done.unread)
    return done


def _key(file: Path, name: str, site: Site) -> PhotoKey:
    try:
        return coco.key_of_image(file, name, site.key_of_picture)
    except FormatError as error:
        error.reason += f"; {OTHER_SITE}"
        raise


def _classified(
    picture: ExportedImage, names: Mapping[str, str], size: tuple[int, int], done: Imported
) -> list[tuple[int, np.ndarray]]:
    """Return the class number and the clipped box of each shape, and count read and skipped shapes in `done`."""
    boxes = []
    for shape in picture.shapes:
        if shape.box is None:
            done.skipped[shape.form] += 1
            continue
        done.classes.add(shape.label)
        kind = names.get(shape.label, shape.label.strip().lower())
        if not kind:
            if not shape.label:
                raise FormatError(f"{shape.where}: the class is missing")
            done.named_out[shape.label] += 1
            continue
        if kind not in BOX_CLASSES:
            raise FormatError(
                f"{shape.where}: {shape.label!r} is neither {' nor '.join(BOX_CLASSES)}: "
                f"add --name '{shape.label}=rock', or --name '{shape.label}=' to exclude the class"
            )
        with with_part(f"{shape.where}: the {kind} {shape.box.round(2).tolist()}"):
            _check(shape.box, size)
        cut = clip(shape.box, *size)
        done.cut += bool(np.abs(cut - shape.box).max() > _MAX_CUT_PX)
        done.read[shape.form] += 1
        boxes.append((BOX_CLASSES.index(kind), cut))
    return boxes


def _check(box: np.ndarray, size: tuple[int, int]) -> None:
    """Raise an error for an implausible box (4,), px."""
    cut, photo = clip(box, *size), np.array(size, float)
    if not np.isfinite(box).all() or (cut[2:] - cut[:2] < _MIN_SIDE_PX).any():
        raise FormatError("no area inside the photo")
    if box.max() <= 1:
        raise FormatError("expected pixels: are these shares of the image size?")
    if (box[:2] < -MAX_OVERHANG * photo).any() or (box[2:] > (1 + MAX_OVERHANG) * photo).any():
        raise FormatError("far outside the photo")


def _coco(source: Path, site: Site, _: Imported) -> Iterator[ExportedImage]:
    for name, size, rows in coco.read_coco_images(source, site.images.size):
        with with_part(name):
            scale = scale_of(*size, site.images.size) if rows else 1.0
        shapes = [ExportedShape(row.where, row.form, row.annotation.kind, row.annotation.box * scale) for row in rows]
        yield ExportedImage(name, shapes)


def _yolo(source: Path, site: Site, done: Imported) -> Iterator[ExportedImage]:
    """Read every `KEY.txt` below a folder."""
    keyed, strays = keyed_label_files(source, site)
    lists: dict[Path, class_lists.ClassList] = {}
    for path in keyed:
        if path.parent not in lists:
            lists[path.parent] = class_lists.find_classes(path.parent, source)
        classes = lists[path.parent]
        shapes = []
        for line in yolo.read_shapes(path, site.images.size):
            if line.number >= len(classes.names) or not classes.names[line.number]:
                stated = f"{classes.path} has {classes}" if classes.path else f"no class list found, assumed {classes}"
                raise line.error(f"class {line.number}: {stated}")
            form = "polygon" if line.is_polygon else "box" if line.confidence is None else "detection"
            shapes.append(ExportedShape(f"{path.name}:{line.line}", form, classes.names[line.number], line.box))
        yield ExportedImage(path.name, shapes)
    for classes in dict.fromkeys(lists.values()):
        origin = f"classes from {classes.path}:" if classes.path else "no class list found: assuming"
        done.notes.append(f"{origin} {classes}")
    if strays:
        done.skipped[STRAY] += len(strays)
        done.notes.append(f"text files without a photo key: {_some([path.name for path in strays])}")


def _label_studio(source: Path, site: Site, done: Imported) -> Iterator[ExportedImage]:
    yield from read_label_studio(source, site)
    if is_predicted(source):
        done.notes.append("no task has an annotation: the labels are uncorrected predictions")


IMPORTERS: dict[str, Callable[[Path, Site, Imported], Iterator[ExportedImage]]] = {
    COCO: _coco,
    YOLO: _yolo,
    CVAT: lambda source, site, _: read_cvat(source, site.images.size),
    LABEL_STUDIO: _label_studio,
}
assert tuple(IMPORTERS) == EXPORT_FORMS

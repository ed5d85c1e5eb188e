"""Files, format and shapes of an export of labels in a file, a folder or a zip archive."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import numpy as np

from polarsim.errors import FormatError, LabelError, PolarsimError
from polarsim.formats import class_lists
from polarsim.formats.files import read_json, suffix_counts
from polarsim.formats.readers import MB, reading
from polarsim.photo import PhotoKey
from polarsim.site import Site

COCO, YOLO, CVAT, LABEL_STUDIO = EXPORT_FORMS = ("coco", "yolo", "cvat", "label-studio")
_MAX_ASPECT_ERROR = 0.01  # maximum relative difference of the aspect ratio of a resized image
_MAX_TEXT_MB = 500  # of all text files of an archive
OTHER_SITE = "for photos of another site, set --site"
_TEXTS = (".xml", ".json", ".txt", ".yaml", ".yml", ".names", ".data")
_EXPECTED = (
    "expected CVAT for images 1.1 (annotations.xml), COCO (images, categories, annotations), Label Studio (a list of "
    "tasks) or YOLO (a folder of KEY.txt)"
)


@dataclass(frozen=True, eq=False)
class ExportedShape:
    """Annotation of an image."""

    where: str  # name in messages, such as "box 3"
    form: str  # kind of annotation, in the singular: "box", "mask", "polyline"
    label: str  # name of the class in the annotation tool
    box: np.ndarray | None  # (4,) bounding box, px of the photo; None for forms without box


@dataclass(frozen=True, eq=False)
class ExportedImage:
    """Image of an export with all annotations."""

    name: str
    shapes: list[ExportedShape]


def scale_of(width: float, height: float, size: tuple[int, int]) -> float:
    """Return the scale from pixels of a resized image to pixels of a photo of a size; the aspect must be equal."""
    if not (width > 0 and height > 0) or abs(width / height * size[1] / size[0] - 1) > _MAX_ASPECT_ERROR:
        raise FormatError(f"{width:g} x {height:g} px, expected the aspect of {size[0]} x {size[1]}; {OTHER_SITE}")
    return size[0] / width


@contextmanager
def unpacked(source: Path) -> Iterator[Path]:
    """Yield the path of an export; the text files of a zip archive are extracted to a temporary folder."""
    if not source.is_file() or not zipfile.is_zipfile(source):
        yield source
        return
    with TemporaryDirectory() as temporary:
        # Class lists above do not belong to the archive.
        folder = Path(temporary, *["export"] * class_lists.MAX_FOLDERS_UP)
        folder.mkdir(parents=True)
        with reading("zip archive", source), zipfile.ZipFile(source) as archive:
            files = [entry for entry in archive.infolist() if not entry.is_dir()]
            entries = [entry for entry in files if Path(entry.filename).suffix.lower() in _TEXTS]
            if not entries:
                names = ", ".join(entry.filename for entry in files[:3])
                raise FormatError(f"no label file among {len(files)} files ({names}); {_EXPECTED}", path=source)
            total = sum(entry.file_size for entry in entries) / MB
            if total > _MAX_TEXT_MB:
                raise FormatError(f"{total:.0f} MB of text, expected at most {_MAX_TEXT_MB} MB", path=source)
            for entry in entries:
                entry.filename = entry.filename.replace("\\", "/")  # archives made by Windows
                archive.extract(entry, folder)  # zipfile never writes outside the folder
        try:
            yield folder
        except PolarsimError as error:
            if error.path is not None and error.path.is_relative_to(folder):
                error.path = source / error.path.relative_to(folder)
            raise


def find_files(source: Path, site: Site, form: str | None = None) -> tuple[str, list[Path]]:
    """Return the format and the files of an export; a YOLO export is a folder.

    `form` is a name in `EXPORT_FORMS`; None: determined from the files.
    """
    if not source.exists():
        raise FormatError("no such file or folder", path=source)
    if source.is_file():
        return _of_file(source, form), [source]
    files = [path for path in _visible(source) if path.is_file()]
    of_form: dict[str, list[Path]] = {}
    for path in files:
        detected = _form_of(path) if path.suffix.lower() in (".xml", ".json") else None
        if detected in EXPORT_FORMS and detected is not None:
            of_form.setdefault(detected, []).append(path)
    keyed, unkeyed = keyed_label_files(source, site)
    if keyed:
        of_form[YOLO] = [source]
    if form is not None:
        of_form = {form: of_form[form]} if form in of_form else {}
    if len(of_form) > 1:
        several = " and ".join(f"{name} ({paths[0].relative_to(source)})" for name, paths in of_form.items())
        raise FormatError(f"files of several formats, {several}: give a file, or set --format", path=source)
    if not of_form:
        hint = f"; {unkeyed[0].name} is no photo key of the site {site.name}: {OTHER_SITE}" if unkeyed else ""
        raise FormatError(
            f"no {form or 'export'} in the folder: found {suffix_counts(source)}; {_EXPECTED}{hint}", path=source
        )
    return next(iter(of_form.items()))


def keyed_label_files(folder: Path, site: Site) -> tuple[list[Path], list[Path]]:
    """Return the YOLO files of a folder, which have a photo key in the name, and the other text files."""
    texts = [path for path in _visible(folder) if path.suffix.lower() == ".txt" and path.is_file()]
    keyed = [path for path in texts if key_in(path.name, site)]
    return keyed, [path for path in texts if path not in keyed and not class_lists.is_class_list(path)]


def _visible(folder: Path) -> list[Path]:
    """Return the paths below a folder without hidden files."""
    hidden = (".", "__MACOSX")
    return sorted(
        path
        for path in folder.rglob("*")
        if not any(part.startswith(hidden) for part in path.relative_to(folder).parts)
    )


def key_in(name: str, site: Site) -> PhotoKey | None:
    """Return the photo key in the name of an image; None if there is none."""
    try:
        return site.key_of_picture(name)
    except LabelError:
        return None


def _of_file(path: Path, form: str | None) -> str:
    if form == YOLO:
        raise FormatError("a file, expected a folder of YOLO labels KEY.txt", path=path)
    if form is not None:
        return form
    detected = _form_of(path)
    if detected in EXPORT_FORMS:
        return str(detected)
    if path.suffix.lower() in (".txt", ".yaml", ".yml", ".names", ".data"):
        raise FormatError("a file of a YOLO data set? Give the folder", path=path)
    raise FormatError(f"{detected or 'neither a folder, nor a zip, nor .json, nor .xml'}: {_EXPECTED}", path=path)


def _form_of(path: Path) -> str | None:
    """Return a name in `EXPORT_FORMS`, or a description of another kind of file; None for neither XML nor JSON."""
    with path.open("rb") as file:
        start = file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip()[:1]
    if path.suffix.lower() == ".xml" or start == b"<":
        with reading("XML", path):
            _, root = next(ElementTree.iterparse(path, ("start",)))  # noqa: S314
        return CVAT if root.tag == "annotations" else f"XML of <{root.tag}>"
    if path.suffix.lower() == ".json" or start in (b"{", b"["):
        return _form_of_json(read_json(path))
    return None


def _form_of_json(content: Any) -> str:
    if isinstance(content, list):
        keys = {key for entry in content if isinstance(entry, dict) for key in entry}
        if content and keys >= {"name", "color"}:
            return "a list of labels"  # of a CVAT task
        return LABEL_STUDIO
    if isinstance(content, dict):
        if "images" in content or "annotations" in content:
            return COCO
        return f"JSON with the keys {', '.join(sorted(content)[:5]) or '(none)'}"
    return "JSON without keys"

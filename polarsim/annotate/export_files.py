"""The files of an export of labels: which tool wrote them, in a file, in a folder or in a zip archive."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

from polarsim.errors import FormatError, LabelError, PolarsimError
from polarsim.formats import yolo
from polarsim.formats.files import census, read_json
from polarsim.formats.readers import MB, reading
from polarsim.photo import PhotoKey

COCO, YOLO, CVAT, LABEL_STUDIO, FIFTYONE = FORMS = ("coco", "yolo", "cvat", "label-studio", "fiftyone")
_LARGEST_MB = 500  # of all texts of an archive together
_TEXTS = (".xml", ".json", ".txt", ".yaml", ".yml", ".names", ".data")
_EXPECTED = (
    "expected CVAT for images 1.1 (annotations.xml), COCO (images, categories, annotations), Label Studio (a list of "
    "tasks), FiftyOne (samples or labels) or YOLO (a folder of KEY.txt)"
)


@contextmanager
def unpacked(source: Path) -> Iterator[Path]:
    """Path of an export outside of its zip archive: the texts of an archive in a temporary folder.

    Raises
    ------
    FormatError
        A damaged archive, or more text than any export has.
    """
    if not source.is_file() or not zipfile.is_zipfile(source):
        yield source
        return
    with TemporaryDirectory() as temporary:
        folder = Path(temporary, *["export"] * yolo.FOLDERS_UP)  # no class list above belongs to the archive
        folder.mkdir(parents=True)
        with reading("zip archive", source), zipfile.ZipFile(source) as archive:
            files = [entry for entry in archive.infolist() if not entry.is_dir()]
            entries = [entry for entry in files if Path(entry.filename).suffix.lower() in _TEXTS]
            if not entries:
                some = ", ".join(entry.filename for entry in files[:3])
                raise FormatError(f"no file of labels among {len(files)} ({some}); {_EXPECTED}", path=source)
            total = sum(entry.file_size for entry in entries) / MB
            if total > _LARGEST_MB:
                raise FormatError(f"{total:.0f} MB of text, no export has more than {_LARGEST_MB}", path=source)
            for entry in entries:
                entry.filename = entry.filename.replace("\\", "/")  # Windows' archives
                archive.extract(entry, folder)  # never outside of the folder
        try:
            yield folder
        except PolarsimError as error:
            if error.path is not None and error.path.is_relative_to(folder):
                error.path = source / error.path.relative_to(folder)
            raise


def find_files(source: Path, form: str | None = None) -> tuple[str, list[Path]]:
    """Return the form of an export and its files; a YOLO export is its folder.

    Parameters
    ----------
    form
        One of `FORMS`; None: that of the files.

    Raises
    ------
    FormatError
        No file of a known form, or files of several forms: what was found.
    """
    if not source.exists():
        raise FormatError("no such file or folder", path=source)
    if source.is_file():
        return _of_file(source, form), [source]
    files = [path for path in _visible(source) if path.is_file()]
    found: dict[str, list[Path]] = {}
    for path in files:
        own = _form_of(path) if path.suffix.lower() in (".xml", ".json") else None
        if own in FORMS and own is not None:
            found.setdefault(own, []).append(path)
    if any(_has_key(path) for path in files if path.suffix.lower() == ".txt"):
        found[YOLO] = [source]
    if form is not None:
        found = {form: found[form]} if form in found else {}
    if len(found) > 1:
        several = " and ".join(f"{own} ({paths[0].relative_to(source)})" for own, paths in found.items())
        raise FormatError(f"{several}: name a file, or one of them with --format", path=source)
    if not found:
        raise FormatError(f"no {form or 'export'} in it: found {census(source)}; {_EXPECTED}", path=source)
    return next(iter(found.items()))


def label_files(folder: Path) -> tuple[dict[Path, PhotoKey], list[Path]]:
    """Return the YOLO files of a folder with the photo keys in their names, and the text files without one."""
    keys, others = {}, []
    for path in _visible(folder):
        if path.suffix.lower() == ".txt" and path.is_file() and path.name != yolo.CLASS_FILE:
            try:
                keys[path] = PhotoKey.of_picture(path.name)
            except LabelError:
                others.append(path)
    return keys, others


def _visible(folder: Path) -> list[Path]:
    """Paths below a folder, without those that an operating system hides."""
    hidden = (".", "__MACOSX")
    return sorted(
        path
        for path in folder.rglob("*")
        if not any(part.startswith(hidden) for part in path.relative_to(folder).parts)
    )


def _has_key(path: Path) -> bool:
    try:
        PhotoKey.of_picture(path.name)
    except LabelError:
        return False
    return True


def _of_file(path: Path, form: str | None) -> str:
    if form == YOLO:
        raise FormatError("YOLO labels are a folder of KEY.txt: name the folder", path=path)
    if form is not None:
        return form
    own = _form_of(path)
    if own in FORMS:
        return str(own)
    if path.suffix.lower() in (".txt", ".yaml", ".yml", ".names", ".data"):
        raise FormatError("a file of a YOLO data set? Name its folder", path=path)
    raise FormatError(f"{own or 'neither a folder, nor a zip, nor .json, nor .xml'}: {_EXPECTED}", path=path)


def _form_of(path: Path) -> str | None:
    """One of `FORMS`, or what else a file is; None for neither XML nor JSON."""
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
        keys = {key for one in content if isinstance(one, dict) for key in one}
        if content and keys >= {"name", "color"}:
            return "a list of labels"  # of a CVAT task
        return LABEL_STUDIO
    if isinstance(content, dict):
        if "samples" in content or isinstance(content.get("labels"), dict):
            return FIFTYONE
        if "images" in content or "annotations" in content:
            return COCO
        return f"JSON with the keys {', '.join(sorted(content)[:5]) or '(none)'}"
    return "JSON without keys"

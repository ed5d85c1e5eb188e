"""Class lists: the names of the class numbers in YOLO label files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats.files import read_json, text_of
from polarsim.formats.readers import reader, reading
from polarsim.formats.yaml_files import read_yaml
from polarsim.photo import BOX_CLASSES

CLASS_FILE = "classes.txt"  # names of the class numbers of the label files in the same folder, one per line
NOTES_FILE = "notes.json"  # class list of Label Studio's YOLO export
MAX_FOLDERS_UP = 2  # Ultralytics stores data.yaml two folders above the label files
_MAX_CLASSES = 10_000


@dataclass(frozen=True)
class ClassList:
    """Names of class numbers and the file that lists them."""

    names: tuple[str, ...]  # by class number; "" for a number without a name
    path: Path | None  # None: no file exists, and `BOX_CLASSES` is assumed

    def __str__(self) -> str:
        return ", ".join(f"{number} {name}" for number, name in enumerate(self.names) if name)


@reader("class list")
def find_classes(folder: Path, top: Path | None = None) -> ClassList:
    """Find the names of the class numbers of the label files in a folder.

    Class lists are `classes.txt`, `*.names` (Darknet, CVAT), `names` of a YAML file (Ultralytics, Roboflow) and
    `notes.json` (Label Studio). They are searched in the folder and in the folders above up to `top`, the folder of the
    data set, in which all lists must agree; then in all folders below `top`, then in the next `MAX_FOLDERS_UP` folders
    above. Without a list, `BOX_CLASSES` is assumed.
    """
    inside = [folder, *(above for above in folder.parents if top and (above == top or top in above.parents))]
    lists = [classes for above in inside for classes in _lists_in(above)]
    if top and not lists:
        below = sorted({path.parent for path in top.rglob("*") if is_class_list(path)})
        lists = [classes for subfolder in below for classes in _lists_in(subfolder)]
    for above in list((top or folder).absolute().parents)[:MAX_FOLDERS_UP]:
        lists = lists or list(_lists_in(above, lenient=True))
    if not lists:
        return ClassList(BOX_CLASSES, None)
    longest = max(lists, key=lambda classes: len(classes.names))
    for classes in lists:
        pairs = zip(map(plain, classes.names), map(plain, longest.names), strict=False)
        if any(name and expected and name != expected for name, expected in pairs):
            reason = f"classes {classes} contradict {longest.path}: {longest}; remove a list"
            raise FormatError(reason, path=classes.path)
    return longest


def class_names(folder: Path) -> tuple[str, ...]:
    """Return the names of the class numbers in a folder, see `find_classes`."""
    return find_classes(folder).names


def plain(name: str) -> str:
    return name.strip().lower()


def is_class_list(path: Path) -> bool:
    return path.name in (CLASS_FILE, NOTES_FILE) or path.suffix.lower() in (".names", ".yaml", ".yml")


def _lists_in(folder: Path, lenient: bool = False) -> Iterator[ClassList]:
    """Yield the class lists in a folder; `lenient` skips unreadable YAML files other than `data.yaml`."""
    for path in sorted(path for path in folder.glob("*") if is_class_list(path) and path.is_file()):
        try:
            names = _names_in(path)
        except PolarsimError:
            if lenient and path.suffix in (".yaml", ".yml") and path.stem != "data":
                continue
            raise
        if names is not None:
            repeated = [name for name in names if name and names.count(name) > 1]
            if repeated:
                raise FormatError(f"class {repeated[0]!r} is listed twice", path=path)
            yield ClassList(names, path)


def _names_in(path: Path) -> tuple[str, ...] | None:
    """Return the names by class number; None for a file without class names."""
    if path.suffix.lower() in (".yaml", ".yml"):
        content = read_yaml(path)
        if not isinstance(content, dict) or "names" not in content:
            return None
        if "kpt_shape" in content:
            raise FormatError("kpt_shape: keypoints are not supported, export boxes or polygons", path=path)
        return _numbered(path, content["names"])
    if path.name == NOTES_FILE:
        content = read_json(path)
        stated = content.get("categories") if isinstance(content, dict) else None
        if not isinstance(stated, list):
            return None
        return _numbered(path, {entry.get("id"): entry.get("name") for entry in stated if isinstance(entry, dict)})
    with reading("class list", path):
        names = tuple(line.strip() for line in text_of(path).rstrip().split("\n"))
    if not any(names):
        raise FormatError(f"no class name, expected a name per line, such as {' and '.join(BOX_CLASSES)}", path=path)
    return names


def _numbered(path: Path, stated: Any) -> tuple[str, ...]:
    """Return the names by class number from a list, or from a dictionary of numbers and names."""
    pairs = dict(enumerate(stated)) if isinstance(stated, list) else stated
    if not isinstance(pairs, dict) or not pairs:
        raise FormatError("names: expected a list of class names, or number: name", path=path)
    names = {}
    for number, name in pairs.items():
        if not is_whole(str(number)) or int(number) >= _MAX_CLASSES or not isinstance(name, (str, int)):
            raise FormatError(f"names: {number!r}: {name!r}, expected number: name", path=path)
        names[int(number)] = str(name)
    return tuple(names.get(number, "") for number in range(max(names) + 1))


def is_whole(text: str) -> bool:
    """Return whether a text is a number of ASCII digits; `int` also accepts digits of other scripts."""
    return text.isascii() and text.isdigit()

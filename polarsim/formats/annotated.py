"""A folder that labelImg opens and saves: pictures, beside each its boxes as `KEY.txt`, and one `classes.txt`.

labelImg rewrites `classes.txt` whenever it saves: with other names in it, or the same in another order, the numbers in
`KEY.txt` mean something else. The names count here, never the numbers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, LabelError
from polarsim.formats import release, yolo
from polarsim.formats.files import write_text
from polarsim.photo import BOX_CLASSES, PhotoKey


def write_class_list(folder: Path) -> None:
    """`classes.txt` of a folder whose label files have this project's class numbers."""
    write_text(folder / release.CLASS_LIST, "".join(f"{name}\n" for name in BOX_CLASSES))


def read_annotated(folder: str | Path) -> dict[PhotoKey, tuple[np.ndarray, np.ndarray]]:
    """Class numbers (n,) and boxes (n, 4), as `yolo.read_boxes` has them, of every `KEY.txt` of a folder.

    `TerrainNN` folders below are read too. `classes.txt` beside a file names its classes; without one they are rock and
    shadow in this order. Pictures and files of other names are left out; the log says which text files these were.

    Raises
    ------
    FormatError
        No such folder, a photo with two files, a class list that is none, or a broken line: file, line and reason.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FormatError("no such folder of label files", path=folder)
    try:
        found = release.key_files(folder)
    except LabelError as error:
        raise FormatError(error.reason, path=error.path) from error
    release.log_strays((path for path in found.stray if path.suffix == ".txt"), str(folder))
    names = {place: read_class_list(place) for place in {path.parent for path in found.files.values()}}
    return {key: yolo.read_boxes(path, names=names[path.parent]) for key, path in found.files.items()}


def read_class_list(folder: Path) -> tuple[str, ...]:
    """What class numbers mean in a folder: the lines of its `classes.txt`, rock and shadow where there is none.

    Raises
    ------
    FormatError
        The list is no text, is empty, or has a name twice.
    """
    path = folder / release.CLASS_LIST
    if not path.exists():
        return BOX_CLASSES
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"no readable class list, {error}", path=path) from error
    names = tuple(line.strip() for line in "\n".join(lines).rstrip().split("\n"))
    if not any(names):
        raise FormatError(f"no class, expected a name a line, such as {' and '.join(BOX_CLASSES)}", path=path)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise FormatError(f"class {twice[0]!r} is there twice", path=path)
    return names

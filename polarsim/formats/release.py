"""The layout of the published release: which file is what, and which names are strays.

`Labels/TerrainNN/KEY.txt`, `SegmentationLabels/terrainNN/labels/KEY.txt`, `TerrainMeshes/TerrainNN/terrainNN_*.obj` and
`CoverPhotoOfIndices/cover_photo_indexed_NN_P.png`. Only exact names count: the release holds copies beside the files.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, LabelError
from polarsim.formats import obj, yolo
from polarsim.formats.files import existing_folder
from polarsim.formats.readers import reader
from polarsim.photo import PhotoKey

BOXES, POLYGONS, MESHES, COVERS = "Labels", "SegmentationLabels", "TerrainMeshes", "CoverPhotoOfIndices"

SNAKEMAKE_FILE = ".snakemake_timestamp"  # in every folder that is an output of a rule
_TERRAIN_FOLDER = re.compile(r"[Tt]errain(\d\d)")
_COVER = re.compile(r"cover_photo_indexed_(\d\d)_([A-G])\.(?i:png)")
_EXAMPLES = 3  # of the strays, in the log

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Layout:
    """Where label files are stored below a root; `{:02d}` stands for the number of a terrain."""

    name: str
    boxes: str
    polygons: str = ""  # "" in a layout without polygons

    def box_folder(self, root: Path, terrain: int) -> Path:
        return root / self.boxes.format(terrain)

    def box_files(self, root: Path, terrain: int) -> KeyFiles:
        """The box files of a terrain; in a flat folder, files of other terrains are no strays."""
        folder = self.box_folder(root, terrain)
        if folder != root:
            return terrain_files(folder, terrain)
        found = key_files(root)
        first = terrain == min((key.terrain for key in found.files), default=terrain)
        own = {key: path for key, path in found.files.items() if key.terrain == terrain}
        return KeyFiles(own, found.stray if first else [])

    def polygon_files(self, root: Path, terrain: int) -> KeyFiles:
        return terrain_files(root / self.polygons.format(terrain), terrain) if self.polygons else KeyFiles()

    def terrains(self, root: Path) -> list[int]:
        """Numbers of the terrains with label files or folders of them."""
        if self.boxes == ".":
            return sorted({key.terrain for key in key_files(root).files})
        parents = {(root / template).parent for template in (self.boxes, self.polygons) if template}
        return _terrains_in(parents)


PUBLISHED = Layout("published", f"{BOXES}/Terrain{{:02d}}", f"{POLYGONS}/terrain{{:02d}}/labels")
OF_RUN = Layout("of a run", "boxes/Terrain{:02d}", "polygons/Terrain{:02d}")  # results/<run>/labels
BY_TERRAIN = Layout("by terrain", "Terrain{:02d}")
FLAT = Layout("flat", ".")


@dataclass
class KeyFiles:
    """The label files of a folder by photo key, and the files that are none."""

    files: dict[PhotoKey, Path] = field(default_factory=dict)
    stray: list[Path] = field(default_factory=list)

    def sort(self) -> KeyFiles:
        """The same in the order of keys and names."""
        return KeyFiles(dict(sorted(self.files.items())), sorted(self.stray))


def key_files(folder: str | Path) -> KeyFiles:
    """Every `KEY.txt` of a folder and of its `TerrainNN` subfolders.

    A file in the folder of another terrain than its key's is a stray. A folder that is not there has no file.

    Raises
    ------
    LabelError
        A key is there twice.
    """
    found = KeyFiles()
    folder = Path(folder)
    if folder.is_dir():
        _collect(folder, _terrain_of(folder.name), found)
        for below in sorted(folder.iterdir()):
            if below.is_dir() and _terrain_of(below.name) is not None:
                _collect(below, _terrain_of(below.name), found)
    return found.sort()


@reader("label folder")
def read_annotated(folder: str | Path) -> dict[PhotoKey, tuple[np.ndarray, np.ndarray]]:
    """Class numbers (n,) and boxes (n, 4), as `yolo.read_boxes` has them, of `key_files` that people edited.

    labelImg rewrites `classes.txt` whenever it saves: with other names in it, or the same in another order, the numbers
    in `KEY.txt` mean something else. The names count here, never the numbers. Pictures and files of other names are
    left out; the log says which text files these were.

    Raises
    ------
    FormatError
        No such folder, a photo with two files, a class list that is none, or a broken line: file, line and reason.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FormatError("no such folder of label files", path=folder)
    try:
        found = key_files(folder)
    except LabelError as error:
        raise FormatError(error.reason, path=error.path) from error
    log_strays((path for path in found.stray if path.suffix == ".txt"), str(folder))
    names = {below: yolo.class_names(below) for below in {path.parent for path in found.files.values()}}
    return {key: yolo.read_boxes(path, names=names[path.parent]) for key, path in found.files.items()}


def terrain_files(folder: Path, terrain: int) -> KeyFiles:
    """Every `KEY.txt` of one terrain in a folder; files of other names or terrains are strays."""
    found = KeyFiles()
    if folder.is_dir():
        _collect(folder, terrain, found)
    return found.sort()


def box_folder(folder: Path) -> Path:
    """The folder of box files in a folder that a user names: the published root, a run's labels, detections.

    These are `Labels`, `boxes` and `labels`; any other folder holds the files itself.
    """
    inside = (folder / name for name in (BOXES, "boxes", "labels"))
    return next((below for below in inside if below.is_dir()), folder)


def polygon_sources(folder: Path) -> list[Path]:
    """The polygon files of a folder that a user names: flat, by terrain, a run's labels, or the published root.

    Raises
    ------
    FormatError
        No such folder, no polygon file, or two files of one name.
    """
    existing_folder(folder)
    places = [below for below in (folder / POLYGONS, folder / "polygons") if below.is_dir()] or [folder]
    folders = [path for place in places for path in (place, *sorted(place.glob("*"))) if path == place or
               _terrain_of(path.name) is not None]  # fmt: skip
    nested = [path / "labels" if (path / "labels").is_dir() else path for path in folders]
    files = [path for below in nested for path in sorted(below.glob("*.txt")) if path.name != yolo.CLASS_FILE]
    if not files:
        raise FormatError("no polygon file (*.txt), in it or in TerrainNN folders", path=folder)
    seen: dict[str, Path] = {}
    for path in files:
        if path.name in seen:
            raise FormatError(f"has the name of {seen[path.name]}", path=path)
        seen[path.name] = path
    return files


def label_folder(root: str | Path, terrain: int) -> Path:
    """Where the boxes of a terrain are published."""
    return PUBLISHED.box_folder(Path(root), terrain)


def polygon_folder(root: str | Path, terrain: int) -> Path:
    """Where the polygons of a terrain are published."""
    return Path(root) / POLYGONS / f"terrain{terrain:02d}" / "labels"


def mesh_folder(root: str | Path, terrain: int) -> Path:
    """Where the meshes of a terrain are published."""
    return Path(root) / MESHES / f"Terrain{terrain:02d}"


def label_files(root: str | Path, terrain: int) -> dict[PhotoKey, Path]:
    """The hand-annotated boxes of a terrain."""
    return key_files(label_folder(root, terrain)).files


def polygon_files(root: str | Path, terrain: int) -> dict[PhotoKey, Path]:
    """The hand-annotated polygons of a terrain."""
    return PUBLISHED.polygon_files(Path(root), terrain).files


def mesh_files(root: str | Path, terrain: int) -> dict[int, Path]:
    """The rock meshes of a terrain by rock id: the full one, or the decimated copy where only that is there."""
    found = obj.rock_files(mesh_folder(root, terrain))
    return {rock: path for rock, path in found.items() if _mesh_terrain(path.name) == terrain}


def ground_file(root: str | Path, terrain: int) -> Path | None:
    """The ground mesh of a terrain, where it is there."""
    path = mesh_folder(root, terrain) / obj.ground_name(terrain)
    return path if path.is_file() else None


def cover_photos(root: str | Path, terrain: int) -> dict[str, Path]:
    """Pictures with rock ids drawn in, by position."""
    found = {}
    for path in sorted((Path(root) / COVERS).glob("*.[pP][nN][gG]")):
        name = _COVER.fullmatch(path.name)
        if name and int(name[1]) == terrain:
            found[name[2]] = path
    return found


def terrains(root: str | Path) -> list[int]:
    """Numbers of the terrains that have a folder of boxes, polygons or meshes."""
    return _terrains_in({Path(root) / name for name in (BOXES, POLYGONS, MESHES)})


def _terrains_in(parents: Iterable[Path]) -> list[int]:
    """Numbers of the terrains that have a folder in one of some folders."""
    folders = [folder for parent in parents for folder in parent.glob("*") if folder.is_dir()]
    return sorted({number for folder in folders if (number := _terrain_of(folder.name)) is not None})


def stray_files(root: str | Path, terrain: int) -> list[Path]:
    """Files in the terrain's folders that the layout does not name: copies, system files, impossible exposures."""
    meshes = mesh_folder(root, terrain)
    stray = [*key_files(label_folder(root, terrain)).stray, *PUBLISHED.polygon_files(Path(root), terrain).stray]
    if meshes.is_dir():
        files = [path for path in meshes.iterdir() if path.is_file() and path.name != SNAKEMAKE_FILE]
        stray += [path for path in files if _mesh_terrain(path.name) != terrain]
    return sorted(stray)


def log_strays(stray: Iterable[Path], where: str) -> None:
    """One line with the number of strays and the first of them; nothing where there are none."""
    names = [path.name for path in stray]
    if names:
        more = ", ..." if len(names) > _EXAMPLES else ""
        log.warning(
            "%s: %d stray files left out: %s%s", where, len(names), ", ".join(map(repr, names[:_EXAMPLES])), more
        )


def key_of(name: str) -> PhotoKey | None:
    """The photo key of a label file's name; None for every other name."""
    if not name.endswith(".txt"):
        return None
    try:
        return PhotoKey.parse(name.removesuffix(".txt"))
    except LabelError:
        return None


def _collect(folder: Path, terrain: int | None, found: KeyFiles) -> None:
    for path in sorted(folder.iterdir()):
        if yolo.is_class_list(path) or path.name == SNAKEMAKE_FILE or not path.is_file():
            continue
        key = key_of(path.name)
        if key is None or (terrain is not None and key.terrain != terrain):
            found.stray.append(path)
        elif key in found.files:
            raise LabelError(f"{key} is also at {found.files[key]}, a photo has one label file", path=path)
        else:
            found.files[key] = path


def _terrain_of(folder: str) -> int | None:
    found = _TERRAIN_FOLDER.fullmatch(folder)
    return int(found[1]) if found else None


def _mesh_terrain(name: str) -> int | None:
    """Terrain that a mesh's name states; None for a name that is no mesh's."""
    rock = obj.parse_rock_name(name)
    if rock:
        return rock[0]
    found = re.fullmatch(r"terrain(\d\d)_ground\.obj", name)
    return int(found[1]) if found else None

"""Layout of the published release: files of each kind, and strays (files with other names).

`Labels/TerrainNN/KEY.txt`, `SegmentationLabels/terrainNN/labels/KEY.txt`, `TerrainMeshes/TerrainNN/terrainNN_*.obj` and
`CoverPhotoOfIndices/cover_photo_indexed_NN_P.png`. Names must match exactly, because the release also contains copies.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from polarsim.errors import FormatError, LabelError
from polarsim.formats import class_lists, mesh_names
from polarsim.formats.files import existing_folder
from polarsim.formats.readers import reader
from polarsim.photo import PhotoKey, Terrain, terrain_text

if TYPE_CHECKING:
    import numpy as np  # a plan needs the paths only

BOXES, POLYGONS, MESHES, COVERS = "Labels", "SegmentationLabels", "TerrainMeshes", "CoverPhotoOfIndices"

SNAKEMAKE_FILE = ".snakemake_timestamp"  # in every folder that a rule writes
_TERRAIN_FOLDER = re.compile(r"[Tt]errain(\d\d)")
_COVER = re.compile(r"cover_photo_indexed_(\d\d)_([A-G])\.(?i:png)")
_EXAMPLES = 3  # maximum number of strays named in the log

log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Layout:
    """Folders of label files below a root; `{:02d}` is replaced by the number of a terrain."""

    boxes: str
    polygons: str = ""  # "" in a layout without polygons

    def box_folder(self, root: Path, terrain: Terrain) -> Path:
        return root / self.boxes.format(terrain)

    def box_files(self, root: Path, terrain: Terrain) -> KeyFiles:
        """Return the box files of a terrain. In a flat folder, files of other terrains are not strays."""
        folder = self.box_folder(root, terrain)
        if folder != root:
            return terrain_files(folder, terrain)
        all_files = key_files(root)
        first = terrain == min((key.terrain for key in all_files.files), default=terrain)
        files = {key: path for key, path in all_files.files.items() if key.terrain == terrain}
        return KeyFiles(files, all_files.stray if first else [])

    def polygon_files(self, root: Path, terrain: Terrain) -> KeyFiles:
        return terrain_files(root / self.polygons.format(terrain), terrain) if self.polygons else KeyFiles()

    def terrains(self, root: Path) -> list[int]:
        """Return the numbers of the terrains with label files or label folders."""
        if self.boxes == ".":
            return sorted({key.terrain for key in key_files(root).files})
        parents = {(root / template).parent for template in (self.boxes, self.polygons) if template}
        return _terrains_in(parents)


PUBLISHED_LAYOUT = Layout(f"{BOXES}/Terrain{{:02d}}", f"{POLYGONS}/terrain{{:02d}}/labels")
RUN_LAYOUT = Layout("boxes/Terrain{:02d}", "polygons/Terrain{:02d}")  # results/<run>/labels
TERRAIN_LAYOUT = Layout("Terrain{:02d}")
FLAT_LAYOUT = Layout(".")


@dataclass
class KeyFiles:
    """Label files of a folder by photo key, and the other files of the folder."""

    files: dict[PhotoKey, Path] = field(default_factory=dict)
    stray: list[Path] = field(default_factory=list)


def key_files(folder: str | Path) -> KeyFiles:
    """Return every `KEY.txt` in a folder and in the `TerrainNN` subfolders.

    A file in the folder of a different terrain is a stray. The result is empty if the folder does not exist.
    """
    below = [path for path in sorted(Path(folder).glob("*")) if path.is_dir() and _terrain_of(path.name) is not None]
    return _collected((path, _terrain_of(path.name)) for path in (Path(folder), *below))


@reader("label folder")
def read_annotated_boxes(folder: str | Path) -> dict[PhotoKey, tuple[np.ndarray, np.ndarray]]:
    """Read the class numbers (n,) and boxes (n, 4) of a folder that annotators edited, as `yolo.read_boxes` does.

    labelImg rewrites `classes.txt` on every save. If the names or their order change, the class numbers in `KEY.txt`
    change their meaning. Classes are therefore identified by name. Images and files with other names are skipped;
    skipped text files are reported in the log.
    """
    from polarsim.formats import yolo  # imports NumPy

    files = key_files(existing_folder(folder))
    log_strays((path for path in files.stray if path.suffix == ".txt"), str(folder))
    names = {below: class_lists.class_names(below) for below in {path.parent for path in files.files.values()}}
    return {key: yolo.read_boxes(path, names=names[path.parent]) for key, path in files.files.items()}


def terrain_files(folder: Path, terrain: Terrain) -> KeyFiles:
    """Return every `KEY.txt` of a terrain in a folder. Files of other names or terrains are strays."""
    return _collected([(folder, terrain)])


def box_folder(folder: Path) -> Path:
    """Return the folder of box files in a folder given by the user.

    It is `Labels` in the published root, `boxes` in the labels of a run, `labels` in detections, or the given folder.
    """
    inside = (folder / name for name in (BOXES, "boxes", "labels"))
    return next((below for below in inside if below.is_dir()), folder)


def polygon_sources(folder: Path) -> list[Path]:
    """Return the polygon files of a folder given by the user: flat, by terrain, labels of a run, or published root."""
    existing_folder(folder)
    tops = [below for below in (folder / POLYGONS, folder / "polygons") if below.is_dir()] or [folder]
    inside = [path for top in tops for path in sorted(top.glob("*")) if _terrain_of(path.name) is not None]
    nested = [path / "labels" if (path / "labels").is_dir() else path for path in (*tops, *inside)]
    files = [path for below in nested for path in sorted(below.glob("*.txt")) if path.name != class_lists.CLASS_FILE]
    if not files:
        raise FormatError("no polygon file (*.txt) in the folder or in TerrainNN subfolders", path=folder)
    path_of_name: dict[str, Path] = {}
    for path in files:
        if path.name in path_of_name:
            raise FormatError(f"{path_of_name[path.name]} has the same name, expected a file per photo", path=path)
        path_of_name[path.name] = path
    return files


def label_folder(root: str | Path, terrain: Terrain) -> Path:
    """Return the folder of the published boxes of a terrain."""
    return PUBLISHED_LAYOUT.box_folder(Path(root), terrain)


def polygon_folder(root: str | Path, terrain: Terrain) -> Path:
    """Return the folder of the published polygons of a terrain."""
    return Path(root) / PUBLISHED_LAYOUT.polygons.format(terrain)


def mesh_folder(root: str | Path, terrain: Terrain) -> Path:
    """Return the folder of the published meshes of a terrain."""
    return Path(root) / MESHES / f"Terrain{terrain_text(terrain)}"


def label_files(root: str | Path, terrain: Terrain) -> dict[PhotoKey, Path]:
    """Return the files of hand-annotated boxes of a terrain."""
    return key_files(label_folder(root, terrain)).files


def polygon_files(root: str | Path, terrain: Terrain) -> dict[PhotoKey, Path]:
    """Return the files of hand-annotated polygons of a terrain."""
    return PUBLISHED_LAYOUT.polygon_files(Path(root), terrain).files


def released_meshes(root: str | Path, terrain: Terrain) -> dict[int, Path]:
    """Return the rock meshes of a terrain by rock id; the decimated mesh only if the full mesh is missing."""
    files = mesh_names.rock_files(mesh_folder(root, terrain))
    return {rock: path for rock, path in files.items() if _mesh_terrain(path.name) == terrain}


def ground_file(root: str | Path, terrain: Terrain) -> Path | None:
    """Return the ground mesh of a terrain; None if it is missing."""
    path = mesh_folder(root, terrain) / mesh_names.ground_name(terrain)
    return path if path.is_file() else None


def cover_photos(root: str | Path, terrain: Terrain) -> dict[str, Path]:
    """Return the cover photos with rock ids by position."""
    photos = {}
    for path in sorted((Path(root) / COVERS).glob("*.[pP][nN][gG]")):
        name = _COVER.fullmatch(path.name)
        if name and int(name[1]) == terrain:
            photos[name[2]] = path
    return photos


def terrains(root: str | Path) -> list[int]:
    """Return the numbers of the terrains with a folder of boxes, polygons or meshes."""
    return _terrains_in({Path(root) / name for name in (BOXES, POLYGONS, MESHES)})


def _terrains_in(parents: Iterable[Path]) -> list[int]:
    """Return the numbers of the terrains with a subfolder in any of the parent folders."""
    folders = [folder for parent in parents for folder in parent.glob("*") if folder.is_dir()]
    return sorted({number for folder in folders if (number := _terrain_of(folder.name)) is not None})


def stray_files(root: str | Path, terrain: Terrain) -> list[Path]:
    """Return the files in the folders of a terrain with names outside the layout: copies, system files and so on."""
    meshes = mesh_folder(root, terrain)
    stray = [*key_files(label_folder(root, terrain)).stray, *PUBLISHED_LAYOUT.polygon_files(Path(root), terrain).stray]
    if meshes.is_dir():
        files = [path for path in meshes.iterdir() if path.is_file() and path.name != SNAKEMAKE_FILE]
        stray += [path for path in files if _mesh_terrain(path.name) != terrain]
    return sorted(stray)


def log_strays(stray: Iterable[Path], where: str) -> None:
    """Log the number of strays and the first names; log no line without strays."""
    names = [path.name for path in stray]
    if names:
        more = ", ..." if len(names) > _EXAMPLES else ""
        log.warning(
            "%s: %d stray files skipped: %s%s", where, len(names), ", ".join(map(repr, names[:_EXAMPLES])), more
        )


def key_of(name: str) -> PhotoKey | None:
    """Return the photo key in the name of a label file; None for other names."""
    if not name.endswith(".txt"):
        return None
    try:
        return PhotoKey.parse(name.removesuffix(".txt"))
    except LabelError:
        return None


def _collected(folders: Iterable[tuple[Path, int | None]]) -> KeyFiles:
    """Return the files of folders, each with the terrain of its files (None: any), sorted by key and name."""
    files: dict[PhotoKey, Path] = {}
    stray = []
    for path, terrain in ((path, terrain) for folder, terrain in folders for path in sorted(folder.glob("*"))):
        if class_lists.is_class_list(path) or path.name == SNAKEMAKE_FILE or not path.is_file():
            continue
        key = key_of(path.name)
        if key is None or (terrain is not None and key.terrain != terrain):
            stray.append(path)
        elif key in files:
            raise LabelError(f"{key} also has the label file {files[key]}: remove a file", path=path)
        else:
            files[key] = path
    return KeyFiles(dict(sorted(files.items())), sorted(stray))


def _terrain_of(folder: str) -> int | None:
    match = _TERRAIN_FOLDER.fullmatch(folder)
    return int(match[1]) if match else None


def _mesh_terrain(name: str) -> int | None:
    """Return the terrain in the file name of a mesh; None for other names."""
    rock = mesh_names.parse_rock_name(name)
    if rock:
        return rock[0]
    match = re.fullmatch(r"terrain(\d\d)_ground\.obj", name)
    return int(match[1]) if match else None

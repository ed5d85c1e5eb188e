"""Layout of the published release: files of each kind, and strays (files with other names).

`Labels/TerrainNN/KEY.txt`, `SegmentationLabels/terrainNN/labels/KEY.txt`, `TerrainMeshes/TerrainNN/terrainNN_*.obj` and
`CoverPhotoOfIndices/cover_photo_indexed_NN_P.png`. Names must match exactly, because the release also contains copies.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from polarsim.errors import FormatError, LabelError
from polarsim.formats import class_lists, mesh_names
from polarsim.formats.files import existing_folder
from polarsim.formats.readers import reader
from polarsim.photo import PhotoKey, Terrain, sorted_terrains, terrain_of_text, terrain_text

if TYPE_CHECKING:
    import numpy as np  # a plan needs the paths only

BOXES, POLYGONS, MESHES, COVERS = "Labels", "SegmentationLabels", "TerrainMeshes", "CoverPhotoOfIndices"

SNAKEMAKE_FILE = ".snakemake_timestamp"  # in every folder that a rule writes
_TERRAIN_FOLDER = re.compile(rf"(?!{MESHES}\Z)[Tt]errain([A-Za-z0-9-]+)")
_COVER = re.compile(r"cover_photo_indexed_([A-Za-z0-9-]+)_([A-Za-z0-9-]+)\.(?i:png)")
_EXAMPLES = 3  # maximum number of strays named in the log

log = logging.getLogger("polarsim")


KeyOf = Callable[[str], PhotoKey]  # `Site.key`, or `PhotoKey.parse` for files that polarsim wrote


@dataclass(frozen=True)
class Layout:
    """Folders of label files below a root; `{terrain}` is replaced by the terrain."""

    boxes: str
    polygons: str = ""  # "" in a layout without polygons

    def box_folder(self, root: Path, terrain: Terrain) -> Path:
        return root / _of_terrain(self.boxes, terrain)

    def box_files(self, root: Path, terrain: Terrain, key_of: KeyOf) -> KeyFiles:
        """Return the box files of a terrain. In a flat folder, files of other terrains are not strays."""
        folder = self.box_folder(root, terrain)
        if folder != root:
            return terrain_files(folder, terrain, key_of)
        all_files = key_files(root, key_of)
        first = terrain == next(iter(sorted_terrains(key.terrain for key in all_files.files)), terrain)
        files = {key: path for key, path in all_files.files.items() if key.terrain == terrain}
        return KeyFiles(files, all_files.stray if first else [])

    def polygon_files(self, root: Path, terrain: Terrain, key_of: KeyOf) -> KeyFiles:
        if not self.polygons:
            return KeyFiles()
        return terrain_files(root / _of_terrain(self.polygons, terrain), terrain, key_of)

    def terrains(self, root: Path, key_of: KeyOf) -> list[Terrain]:
        """Return the terrains with label files or label folders."""
        if self.boxes == ".":
            return sorted_terrains(key.terrain for key in key_files(root, key_of).files)
        parents = {(root / template).parent for template in (self.boxes, self.polygons) if template}
        return _terrains_in(parents)


PUBLISHED_LAYOUT = Layout(f"{BOXES}/Terrain{{terrain}}", f"{POLYGONS}/terrain{{terrain}}/labels")
RUN_LAYOUT = Layout("boxes/Terrain{terrain}", "polygons/Terrain{terrain}")  # results/<run>/labels
TERRAIN_LAYOUT = Layout("Terrain{terrain}")
FLAT_LAYOUT = Layout(".")


@dataclass
class KeyFiles:
    """Label files of a folder by photo key, and the other files of the folder."""

    files: dict[PhotoKey, Path] = field(default_factory=dict)
    stray: list[Path] = field(default_factory=list)


def key_files(folder: str | Path, key_of: KeyOf = PhotoKey.parse) -> KeyFiles:
    """Return every `KEY.txt` in a folder and in the `TerrainNN` subfolders.

    A file in the folder of a different terrain is a stray. The result is empty if the folder does not exist.
    """
    below = [path for path in sorted(Path(folder).glob("*")) if path.is_dir() and _terrain_of(path.name) is not None]
    return _collected(((path, _terrain_of(path.name)) for path in (Path(folder), *below)), key_of)


@reader("label folder")
def read_annotated_boxes(
    folder: str | Path, size: tuple[int, int], key_of: KeyOf
) -> dict[PhotoKey, tuple[np.ndarray, np.ndarray]]:
    """Read the class numbers (n,) and boxes (n, 4) of a folder that annotators edited, as `yolo.read_boxes` does.

    labelImg rewrites `classes.txt` on every save. If the names or their order change, the class numbers in `KEY.txt`
    change their meaning. Classes are therefore identified by name. Images and files with other names are skipped;
    skipped text files are reported in the log.
    """
    from polarsim.formats import yolo  # imports NumPy

    files = key_files(existing_folder(folder), key_of)
    log_strays((path for path in files.stray if path.suffix == ".txt"), str(folder))
    names = {below: class_lists.class_names(below) for below in {path.parent for path in files.files.values()}}
    return {key: yolo.read_boxes(path, size, names[path.parent]) for key, path in files.files.items()}


def terrain_files(folder: Path, terrain: Terrain, key_of: KeyOf = PhotoKey.parse) -> KeyFiles:
    """Return every `KEY.txt` of a terrain in a folder. Files of other names or terrains are strays."""
    return _collected([(folder, terrain)], key_of)


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
    return Path(root) / _of_terrain(PUBLISHED_LAYOUT.polygons, terrain)


def mesh_folder(root: str | Path, terrain: Terrain) -> Path:
    """Return the folder of the published meshes of a terrain."""
    return Path(root) / MESHES / f"Terrain{terrain_text(terrain)}"


def label_files(root: str | Path, terrain: Terrain, key_of: KeyOf = PhotoKey.parse) -> dict[PhotoKey, Path]:
    """Return the files of hand-annotated boxes of a terrain."""
    return key_files(label_folder(root, terrain), key_of).files


def polygon_files(root: str | Path, terrain: Terrain, key_of: KeyOf = PhotoKey.parse) -> dict[PhotoKey, Path]:
    """Return the files of hand-annotated polygons of a terrain."""
    return PUBLISHED_LAYOUT.polygon_files(Path(root), terrain, key_of).files


def released_meshes(root: str | Path, terrain: Terrain) -> dict[int, Path]:
    """Return the rock meshes of a terrain by rock id; the decimated mesh only if the full mesh is missing."""
    files = mesh_names.rock_files(mesh_folder(root, terrain))
    return {rock: path for rock, path in files.items() if mesh_names.terrain_of_mesh(path.name) == terrain}


def ground_file(root: str | Path, terrain: Terrain) -> Path | None:
    """Return the ground mesh of a terrain; None if it is missing."""
    path = mesh_folder(root, terrain) / mesh_names.ground_name(terrain)
    return path if path.is_file() else None


def cover_photos(root: str | Path, terrain: Terrain) -> dict[str, Path]:
    """Return the cover photos with rock ids by position."""
    photos = {}
    for path in sorted((Path(root) / COVERS).glob("*.[pP][nN][gG]")):
        name = _COVER.fullmatch(path.name)
        if name and terrain_of_text(name[1]) == terrain:
            photos[name[2]] = path
    return photos


def terrains(root: str | Path) -> list[Terrain]:
    """Return the terrains with a folder of boxes, polygons or meshes."""
    return _terrains_in({Path(root) / name for name in (BOXES, POLYGONS, MESHES)})


def _terrains_in(parents: Iterable[Path]) -> list[Terrain]:
    """Return the terrains with a subfolder in any of the parent folders."""
    folders = [folder for parent in parents for folder in parent.glob("*") if folder.is_dir()]
    found = (_terrain_of(folder.name) for folder in folders)
    return sorted_terrains(terrain for terrain in found if terrain is not None)


def stray_files(root: str | Path, terrain: Terrain, key_of: KeyOf) -> list[Path]:
    """Return the files in the folders of a terrain with names outside the layout: copies, system files and so on."""
    meshes = mesh_folder(root, terrain)
    boxes = key_files(label_folder(root, terrain), key_of)
    stray = [*boxes.stray, *PUBLISHED_LAYOUT.polygon_files(Path(root), terrain, key_of).stray]
    if meshes.is_dir():
        files = [path for path in meshes.iterdir() if path.is_file() and path.name != SNAKEMAKE_FILE]
        stray += [path for path in files if mesh_names.terrain_of_mesh(path.name) != terrain]
    return sorted(stray)


def log_strays(stray: Iterable[Path], where: str) -> None:
    """Log the number of strays and the first names; log no line without strays."""
    names = [path.name for path in stray]
    if names:
        more = ", ..." if len(names) > _EXAMPLES else ""
        log.warning(
            "%s: %d stray files skipped: %s%s", where, len(names), ", ".join(map(repr, names[:_EXAMPLES])), more
        )


def key_of_file(name: str, key_of: KeyOf) -> PhotoKey | None:
    """Return the photo key in the name of a label file; None for other names."""
    if not name.endswith(".txt"):
        return None
    try:
        return key_of(name.removesuffix(".txt"))
    except LabelError:
        return None


def _collected(folders: Iterable[tuple[Path, Terrain | None]], key_of: KeyOf) -> KeyFiles:
    """Return the files of folders, each with the terrain of its files (None: any), sorted by key and name."""
    files: dict[PhotoKey, Path] = {}
    stray = []
    for path, terrain in ((path, terrain) for folder, terrain in folders for path in sorted(folder.glob("*"))):
        if class_lists.is_class_list(path) or path.name == SNAKEMAKE_FILE or not path.is_file():
            continue
        key = key_of_file(path.name, key_of)
        if key is None or (terrain is not None and key.terrain != terrain):
            stray.append(path)
        elif key in files:
            raise LabelError(f"{key} also has the label file {files[key]}: remove a file", path=path)
        else:
            files[key] = path
    return KeyFiles(dict(sorted(files.items())), sorted(stray))


def _of_terrain(template: str, terrain: Terrain) -> str:
    return template.format(terrain=terrain_text(terrain))


def _terrain_of(folder: str) -> Terrain | None:
    match = _TERRAIN_FOLDER.fullmatch(folder)
    return terrain_of_text(match[1]) if match else None

"""A published folder looked through: what it holds, and which files have a defect that one can see without photos."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from polarsim.acquire.defects import (
    SEVERITY,
    Boxes,
    Severity,
    box_defects,
    missing_exposures,
    polygon_defects,
    set_defects,
)
from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import obj, png, release, yolo
from polarsim.photo import BOX_CLASSES, PhotoKey, is_exposure
from polarsim.progress import track

Content = TypeVar("Content")

_KEY_AT_START = re.compile(r"\d\d_[A-G]_(?:on|off)_(?:no|30|180|270|350)_[LR]_(\d{4})")


@dataclass(frozen=True)
class Finding:
    """One defect of one file, below the root."""

    severity: Severity
    defect: str
    file: str
    detail: str = ""


def validate_release(root: Path) -> dict[str, Any]:
    """Look through every terrain of a folder in the published layout.

    Returns
    -------
    dict
        `terrains`: number -> counts of files and boxes; `findings`: severity, defect, file and detail of each, by file;
        `counts`: defect -> terrain -> files; `errors` and `warnings`: how many findings.

    Raises
    ------
    FormatError
        The folder is missing or has no terrain.
    """
    root = Path(root)
    terrains = release.terrains(root)
    if not terrains:
        raise FormatError(
            f"{root}: no terrain, looked for {release.BOXES}/TerrainNN, {release.POLYGONS}/terrainNN and "
            f"{release.MESHES}/TerrainNN"
        )
    counts: dict[str, dict[str, int]] = {}
    findings: list[Finding] = []
    for terrain in track(terrains, "validating terrains"):
        found, content = validate_terrain(root, terrain)
        counts[f"{terrain:02d}"] = content
        findings += found
    tally: dict[str, Counter[str]] = {}
    for finding in findings:
        terrain_name = re.search(r"[Tt]errain(\d\d)|indexed_(\d\d)_", finding.file)
        assert terrain_name
        tally.setdefault(finding.defect, Counter())[terrain_name[1] or terrain_name[2]] += 1
    severities = Counter(finding.severity for finding in findings)
    return {
        "terrains": counts,
        "findings": [asdict(finding) for finding in findings],
        "counts": {defect: dict(sorted(tally[defect].items())) for defect in sorted(tally)},
        "errors": severities["error"],
        "warnings": severities["warning"],
    }


def validate_terrain(root: Path, terrain: int) -> tuple[list[Finding], dict[str, int]]:
    """Findings of one terrain in the order of files, and counts of what it holds."""
    found = _Findings(root, [])
    for path in release.stray_files(root, terrain):
        found.add(path, *_stray(path))
    content = {
        **_validate_boxes(root, terrain, found),
        **_validate_polygons(root, terrain, found),
        **_validate_scene(root, terrain, found),
    }
    return sorted(found.findings, key=lambda finding: (finding.file, finding.defect)), content


@dataclass
class _Findings:
    """Gathers findings; files are named below the root."""

    root: Path
    findings: list[Finding]

    def add(self, path: Path, defect: str, detail: str = "") -> None:
        self.findings.append(Finding(SEVERITY[defect], defect, path.relative_to(self.root).as_posix(), detail))

    def read(self, path: Path, reader: Callable[[Path], Content], defect: str) -> Content | None:
        """What a file holds, or a finding and None."""
        try:
            return reader(path)
        except (PolarsimError, OSError) as error:
            self.add(path, defect, str(error).removeprefix(str(path)).lstrip(": "))
            return None


def _validate_boxes(root: Path, terrain: int, found: _Findings) -> dict[str, int]:
    files = release.label_files(root, terrain)
    boxes = {key: content for key, path in files.items() if (content := found.read(path, yolo.read_boxes, "malformed"))}
    for key, (classes, places) in boxes.items():
        for defect, detail in box_defects(classes, places):
            found.add(files[key], defect, detail)
    for key, defect, detail in _sibling_defects(set(files), boxes):
        found.add(release.label_folder(root, terrain) / f"{key}.txt", defect, detail)
    drawn = {
        f"{name}_boxes": sum(int((classes == number).sum()) for classes, _ in boxes.values())
        for number, name in enumerate(BOX_CLASSES)
    }
    return {"label_files": len(files), **drawn}


def _validate_polygons(root: Path, terrain: int, found: _Findings) -> dict[str, int]:
    files = release.polygon_files(root, terrain)
    for path in files.values():
        for defect, detail in polygon_defects(found.read(path, yolo.read_polygons, "malformed") or []):
            found.add(path, defect, detail)
    return {"polygon_files": len(files)}


def _validate_scene(root: Path, terrain: int, found: _Findings) -> dict[str, int]:
    meshes, ground = release.mesh_files(root, terrain), release.ground_file(root, terrain)
    for path in [*meshes.values(), *([ground] if ground else [])]:
        found.read(path, obj.read, "unreadable_mesh")
    covers = release.cover_photos(root, terrain)
    for path in covers.values():
        found.read(path, lambda picture: png.parse_header(picture.read_bytes()), "unreadable_picture")
    return {"meshes": len(meshes), "ground_meshes": int(ground is not None), "cover_photos": len(covers)}


def _stray(path: Path) -> tuple[str, str]:
    """Why a file is none of the layout's."""
    if release.key_of(path.name) is not None:
        return "wrong_folder", "the key is of another terrain"
    if path.name.startswith("."):
        return "system_file", ""
    exposure = _KEY_AT_START.fullmatch(path.stem)
    if exposure and not is_exposure(int(exposure[1])):
        return "impossible_exposure", f"{int(exposure[1])} ms, expected 16, 32, 64 ... 8192"
    twin = _KEY_AT_START.match(path.name)
    if not twin or not (regular := path.with_name(f"{twin[0]}.txt")).is_file():
        return "stray_name", "no name of the layout"
    same = regular.read_bytes() == path.read_bytes()
    return "stray_name", f"{'the same bytes as' if same else 'other content than'} {regular.name}"


def _sibling_defects(there: set[PhotoKey], boxes: dict[PhotoKey, Boxes]) -> Iterator[tuple[PhotoKey, str, str]]:
    """Defects that only the other files of a photo set show."""
    sets: dict[tuple[object, ...], set[PhotoKey]] = {}
    for key in sorted(there):
        sets.setdefault(key.photo_set, set()).add(key)
    for photo_set in sets.values():
        for key in missing_exposures(photo_set):
            yield key, "missing_file", f"{len(photo_set)} other exposures are there"
        yield from set_defects({key: boxes[key] for key in sorted(photo_set) if key in boxes})

"""Folders looked through for defects that one can see without photos: published ones, and ones of pictures.

Folders of pictures are as YOLO trainers have them: `images/.../NAME.png` beside `labels/.../NAME.txt`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import obj, png, release, yolo
from polarsim.lint.files import (
    Boxes,
    Polygons,
    Size,
    against_boxes,
    box_defects,
    count_defects,
    file_defects,
    other_camera,
    ring_defects,
)
from polarsim.lint.findings import Finding, Findings, Report
from polarsim.lint.repair import write_repaired
from polarsim.lint.rules import RULES, Defect
from polarsim.lint.siblings import missing_exposures, set_defects, sibling_defects
from polarsim.lint.views import view_defects
from polarsim.photo import BOX_CLASSES, SUNS, PhotoKey, by_bracket, is_exposure
from polarsim.progress import track

Terrain = tuple[list[Finding], dict[str, int]]
_KEY_AT_START = re.compile(r"\d\d_[A-G]_(?:on|off)_(?:no|30|180|270|350)_[LR]_(\d{4})")
IMAGES, LABELS = "images", "labels"
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


def lint_release(root: Path, workers: int = 1) -> Report:
    """Look through every terrain of a folder in the published layout.

    Parameters
    ----------
    workers : int
        Processes that share the terrains.

    Raises
    ------
    FormatError
        The folder is missing or has no terrain.
    """
    root = Path(root)
    terrains = release.terrains(root)
    if not terrains:
        raise FormatError(
            f"no terrain, looked for {release.BOXES}/TerrainNN, {release.POLYGONS}/terrainNN and "
            f"{release.MESHES}/TerrainNN",
            path=root,
        )
    findings: list[Finding] = []
    contents = {}
    for terrain, (found, content) in zip(terrains, _each(partial(lint_terrain, root), terrains, workers), strict=True):
        findings += found
        contents[f"Terrain{terrain:02d}"] = content
    return Report(findings, contents)


def _each(look: Callable[[int], Terrain], terrains: list[int], workers: int) -> Iterator[Terrain]:
    with ProcessPoolExecutor(workers) as pool:
        results = pool.map(look, terrains) if workers > 1 and len(terrains) > 1 else map(look, terrains)
        for _, result in zip(track(terrains, "validating terrains"), results, strict=True):
            yield result


def lint_terrain(root: Path, terrain: int) -> Terrain:
    """Findings of one terrain in the order of files, and counts of what it holds."""
    found = Findings(root)
    for path in release.stray_files(root, terrain):
        found.add(path, _stray(path))
    files, outlines = release.label_files(root, terrain), release.polygon_files(root, terrain)
    boxes = found.read_all(files, yolo.read_boxes)
    content = {
        **_lint_boxes(files, release.label_folder(root, terrain), boxes, found),
        **_lint_polygons(outlines, found.read_all(outlines, yolo.read_polygons), boxes, found),
        **_lint_scene(root, terrain, found),
    }
    return sorted(found.gathered), content


def _lint_boxes(
    files: Mapping[PhotoKey, Path], folder: Path, boxes: Mapping[PhotoKey, Boxes], found: Findings
) -> dict[str, int]:
    for key, labels in boxes.items():
        counts = count_defects(labels[0]) if key.azimuth in SUNS else ()
        for defect in (*box_defects(*labels), *counts):
            found.add(files[key], defect)
    for keys in by_bracket(files).values():
        for key in missing_exposures(set(keys)):
            found.add(folder / f"{key}.txt", Defect("missing_file", f"{len(keys)} other exposures are there"))
        for key, defect in set_defects({key: boxes[key] for key in keys if key in boxes}):
            found.add(files[key], defect)
    for key, defect in (*sibling_defects(boxes), *view_defects(boxes)):
        found.add(files[key], defect)
    annotated = {
        f"{name}_boxes": sum(int((classes == number).sum()) for classes, _ in boxes.values())
        for number, name in enumerate(BOX_CLASSES)
    }
    return {"label_files": len(files), **annotated}


def _lint_polygons(
    files: Mapping[PhotoKey, Path],
    polygons: Mapping[PhotoKey, Polygons],
    boxes: Mapping[PhotoKey, Boxes],
    found: Findings,
) -> dict[str, int]:
    own: dict[int, list[Defect]] = {}  # by content: most exposures of an exposure bracket share one
    for key, annotated in polygons.items():
        if id(annotated) not in own:
            own[id(annotated)] = [*ring_defects(annotated), *file_defects(annotated)]
        beside = against_boxes(annotated, boxes[key]) if key in boxes else ()
        for defect in (*own[id(annotated)], *beside, *other_camera(annotated, key, boxes)):
            found.add(files[key], defect)
    return {"polygon_files": len(files)}


def _lint_scene(root: Path, terrain: int, found: Findings) -> dict[str, int]:
    meshes, ground = release.mesh_files(root, terrain), release.ground_file(root, terrain)
    for path in [*meshes.values(), *([ground] if ground else [])]:
        found.read(path, obj.read, "unreadable_mesh")
    covers = release.cover_photos(root, terrain)
    for path in covers.values():
        found.read(path, lambda picture: png.parse_header(picture.read_bytes()), "unreadable_picture")
    return {"meshes": len(meshes), "ground_meshes": int(ground is not None), "cover_photos": len(covers)}


def _stray(path: Path) -> Defect:
    """Why a file is none of the layout's."""
    if release.key_of(path.name) is not None:
        return Defect("wrong_folder", "the key is of another terrain")
    if path.name.startswith("."):
        return Defect("system_file")
    exposure = _KEY_AT_START.fullmatch(path.stem)
    if exposure and not is_exposure(int(exposure[1])):
        return Defect("impossible_exposure", f"{int(exposure[1])} ms, expected 16, 32, 64 ... 8192")
    twin = _KEY_AT_START.match(path.name)
    if not twin or not (regular := path.with_name(f"{twin[0]}.txt")).is_file():
        return Defect("stray_name", "no name of the layout")
    same = regular.read_bytes() == path.read_bytes()
    return Defect("stray_name", f"{'the same bytes as' if same else 'other content than'} {regular.name}")


def is_picture_folder(root: Path) -> bool:
    return (root / IMAGES).is_dir() and (root / LABELS).is_dir()


def lint_pictures(root: Path) -> Report:
    """Look at every label file beside its picture, whose size counts.

    Raises
    ------
    FormatError
        There is no label file.
    """
    pictures = {_stem(path, root / IMAGES): path for path in _files(root / IMAGES, SUFFIXES)}
    labels = {_stem(path, root / LABELS): path for path in _files(root / LABELS, (".txt",))}
    if not labels:
        raise FormatError("no label file (*.txt)", path=root / LABELS)
    found = Findings(root)
    boxes = 0
    for stem in sorted(set(pictures) - set(labels)):
        found.add(pictures[stem], Defect("missing_labels"))
    for stem, path in track(sorted(labels.items()), "validating labels"):
        if stem not in pictures:
            found.add(path, Defect("missing_picture"))
            continue
        size = found.read(pictures[stem], _size, "unreadable_picture")
        content = found.read(path, partial(yolo.read_boxes, size=size), "malformed") if size else None
        if content is not None and size is not None:
            boxes += len(content[0])
            for defect in box_defects(*content, size):
                found.add(path, defect)
    return Report(
        sorted(found.gathered), {"folder": {"pictures": len(pictures), "label_files": len(labels), "boxes": boxes}}
    )


def _files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    return sorted(
        path for path in folder.rglob("*") if path.suffix.lower() in suffixes and path.name != yolo.CLASS_FILE
    )


def _stem(path: Path, folder: Path) -> str:
    return path.relative_to(folder).with_suffix("").as_posix()


def _size(path: Path) -> Size:
    """Width and height of a picture."""
    import cv2

    content = np.frombuffer(path.read_bytes(), np.uint8)
    picture = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if len(content) else None
    if picture is None:
        raise FormatError("no picture", path=path)
    return picture.shape[1], picture.shape[0]


def lint(root: Path, names: Collection[str], *, workers: int = 1, fix: Path | None = None) -> Report:
    """Findings of some rules in a folder of the published layout, or in one of pictures and labels.

    Parameters
    ----------
    names
        Of the rules that count, see `rules.chosen`.
    fix
        Folder to which a repaired copy is written; the published layout only.

    Raises
    ------
    FormatError
        The folder is missing or of neither form, or no copy can be written.
    """
    root = Path(root)
    if is_picture_folder(root) and not release.terrains(root):
        if fix is not None:
            raise FormatError("repaired copies are written of the published layout only", path=root)
        return lint_pictures(root).chosen(names)
    report = lint_release(root, workers).chosen(names)
    if fix is not None:
        write_repaired(root, report.findings, fix)
    return report


def rule_lines() -> list[str]:
    """One line a rule, by code."""
    rows = sorted((rule.code, rule.severity, name, rule) for name, rule in RULES.items())
    return [
        f"{code}  {severity:7}  {name:22}  {rule.meaning}" + (f"; --fix {rule.repair}" if rule.repair else "")
        for code, severity, name, rule in rows
    ]

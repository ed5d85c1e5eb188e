"""A published folder looked through: what it holds, and which files have a defect that one can see without photos."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats import obj, png, release, yolo
from polarsim.lint.boxes import Boxes, box_defects, count_defects
from polarsim.lint.exposures import brackets, missing_exposures, set_defects
from polarsim.lint.findings import Finding, Findings, Report
from polarsim.lint.polygons import Polygons, against_boxes, file_defects, other_camera, ring_defects
from polarsim.lint.rules import Defect
from polarsim.lint.siblings import sibling_defects
from polarsim.lint.views import view_defects
from polarsim.photo import BOX_CLASSES, SUNS, PhotoKey, is_exposure
from polarsim.progress import track

Terrain = tuple[list[Finding], dict[str, int]]
_KEY_AT_START = re.compile(r"\d\d_[A-G]_(?:on|off)_(?:no|30|180|270|350)_[LR]_(\d{4})")


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
    for keys in brackets(files):
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

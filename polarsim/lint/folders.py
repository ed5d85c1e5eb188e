"""Validation of folders of labels: label files named by photo keys, and label files with pictures.

Label files with pictures are stored in the layouts of YOLO trainers: in `images/` and `labels/` with the same inner
folders, in `images/` and `labels/` of each part, or in one folder.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats import class_lists, obj, png, release, yolo
from polarsim.formats.files import existing_folder, suffix_counts
from polarsim.formats.release import Layout
from polarsim.lint.files import (
    Boxes,
    Polygons,
    box_defects,
    count_defects,
    file_defects,
    other_camera,
    polygon_box_mismatches,
    ring_defects,
)
from polarsim.lint.findings import Finding, Findings, Report
from polarsim.lint.repair import write_repaired
from polarsim.lint.rules import RULES, Defect
from polarsim.lint.siblings import missing_exposures, set_defects, sibling_defects
from polarsim.lint.views import view_defects
from polarsim.photo import BOX_CLASSES, PhotoKey, Terrain, by_bracket, leading_key, terrain_text
from polarsim.progress import track
from polarsim.run_files.run import Run
from polarsim.site import Site, polar

log = logging.getLogger("polarsim")

FindingsOfTerrain = tuple[list[Finding], dict[str, int]]
IMAGES, LABELS = ("images", "pictures"), ("labels",)  # folders of pictures and labels; `detect` writes pictures/


def lint_release(
    root: Path, workers: int = 1, layout: Layout = release.PUBLISHED_LAYOUT, site: Site | None = None
) -> Report:
    """Validate every terrain of a folder of label files; each of the processes validates a terrain at a time.

    `site` is the site of the photos, NASA's POLAR by default.
    """
    root, site = Path(root), site or polar()
    found = release.terrains(root) if layout == release.PUBLISHED_LAYOUT else layout.terrains(root, site.key)
    terrains = [terrain for terrain in found if terrain in site.terrains]
    if unknown := [terrain_text(terrain) for terrain in found if terrain not in site.terrains]:
        log.warning("%s: terrains skipped that the site %s does not have: %s", root, site.name, ", ".join(unknown))
    if not terrains:
        raise FormatError(
            f"no terrain: expected {release.BOXES}/TerrainNN, {release.POLYGONS}/terrainNN or "
            f"{release.MESHES}/TerrainNN",
            path=root,
        )
    report = Report([], {})
    lint = partial(lint_terrain, root, site=site, layout=layout)
    with ProcessPoolExecutor(workers) as pool:
        results = pool.map(lint, terrains) if workers > 1 and len(terrains) > 1 else map(lint, terrains)
        for terrain, (findings, content) in zip(track(terrains, "validating terrains"), results, strict=True):
            report.findings.extend(findings)
            report.contents[f"Terrain{terrain_text(terrain)}"] = content
    return report


def lint_terrain(
    root: Path, terrain: Terrain, site: Site, layout: Layout = release.PUBLISHED_LAYOUT
) -> FindingsOfTerrain:
    """Return the findings of a terrain in the order of files, and counts of its content.

    Published labels are boxes; label files in other layouts may be detections, with a confidence.
    """
    findings = Findings(root)
    published = layout == release.PUBLISHED_LAYOUT
    size = site.images.size
    boxes_of, polygons_of = layout.box_files(root, terrain, site.key), layout.polygon_files(root, terrain, site.key)
    if not layout.polygons:
        boxes_of, polygons_of = _by_content(boxes_of)
    strays = sorted([*boxes_of.stray, *polygons_of.stray])
    for path in release.stray_files(root, terrain, site.key) if published else strays:
        findings.add(path, _stray(path, site))
    boxes = findings.read_all(boxes_of.files, _box_reader(size, detections=not published))
    polygons = findings.read_all(polygons_of.files, partial(yolo.read_polygons, size=size))
    content = {
        **_lint_boxes(boxes_of.files, layout.box_folder(root, terrain), boxes, findings, site),
        **_lint_polygons(polygons_of.files, polygons, boxes, findings, size),
        **(_lint_scene(root, terrain, findings) if published else {}),
    }
    return sorted(findings.gathered), content


def _by_content(files: release.KeyFiles) -> tuple[release.KeyFiles, release.KeyFiles]:
    """Return the box files and the polygon files of a folder that may hold either."""
    polygons = {key: path for key, path in files.files.items() if yolo.has_polygons(path)}
    boxes = {key: path for key, path in files.files.items() if key not in polygons}
    return release.KeyFiles(boxes, files.stray), release.KeyFiles(polygons)


def _box_reader(size: tuple[int, int], *, detections: bool) -> Callable[[Path], Boxes]:
    """Return a reader of box files with the class numbers of their folder's class list."""
    names = cache(class_lists.class_names)
    return lambda path: yolo.read_boxes(path, size, names(path.parent), detections)


def _lint_boxes(
    files: Mapping[PhotoKey, Path], folder: Path, boxes: Mapping[PhotoKey, Boxes], findings: Findings, site: Site
) -> dict[str, int]:
    for key, labels in boxes.items():
        counts = count_defects(labels[0]) if key.has_sun else ()
        for defect in (*box_defects(*labels, site.images.size), *counts):
            findings.add(files[key], defect)
    for keys in by_bracket(files).values():
        for key in missing_exposures(set(keys), site):
            findings.add(folder / f"{key}.txt", Defect("missing_file", f"{len(keys)} other exposures exist"))
        for key, defect in set_defects({key: boxes[key] for key in keys if key in boxes}):
            findings.add(files[key], defect)
    for key, defect in (*sibling_defects(boxes, site), *view_defects(boxes, site)):
        findings.add(files[key], defect)
    annotated = {
        f"{name}_boxes": sum(int((classes == number).sum()) for classes, _ in boxes.values())
        for number, name in enumerate(BOX_CLASSES)
    }
    return {"label_files": len(files), **annotated}


def _lint_polygons(
    files: Mapping[PhotoKey, Path],
    polygons: Mapping[PhotoKey, Polygons],
    boxes: Mapping[PhotoKey, Boxes],
    findings: Findings,
    size: tuple[int, int],
) -> dict[str, int]:
    own_defects: dict[int, list[Defect]] = {}  # by content, because most exposures of a bracket have the same
    for key, annotated in polygons.items():
        if id(annotated) not in own_defects:
            own_defects[id(annotated)] = [*ring_defects(annotated, size), *file_defects(annotated, size)]
        mismatches = polygon_box_mismatches(annotated, boxes[key]) if key in boxes else ()
        for defect in (*own_defects[id(annotated)], *mismatches, *other_camera(annotated, key, boxes)):
            findings.add(files[key], defect)
    return {"polygon_files": len(files)}


def _lint_scene(root: Path, terrain: Terrain, findings: Findings) -> dict[str, int]:
    meshes, ground = release.released_meshes(root, terrain), release.ground_file(root, terrain)
    for path in [*meshes.values(), *([ground] if ground else [])]:
        findings.read(path, obj.read_obj, "unreadable_mesh")
    covers = release.cover_photos(root, terrain)
    for path in covers.values():
        findings.read(path, lambda picture: png.parse_header(picture.read_bytes()), "unreadable_picture")
    return {"meshes": len(meshes), "ground_meshes": int(ground is not None), "cover_photos": len(covers)}


def _stray(path: Path, site: Site) -> Defect:
    """Return the reason why a file does not belong to the layout."""
    if release.key_of_file(path.name, site.key) is not None:
        return Defect("wrong_folder", "the key is of another terrain")
    if path.name.startswith("."):
        return Defect("system_file")
    key = leading_key(path.name)
    if key and path.stem == str(key) and key.terrain in site.terrains and key.azimuth in site.azimuths:
        exposures = site.exposures_of(key.terrain, key.azimuth)
        if key.exposure_ms not in exposures and release.key_of_file(f"{key.with_exposure(exposures[0])}.txt", site.key):
            expected = ", ".join(map(str, exposures))
            return Defect("impossible_exposure", f"{key.exposure_ms} ms, expected {expected}")
    if not key or not (regular := path.with_name(f"{key}.txt")).is_file():
        return Defect("stray_name", "not a name of the layout")
    same = regular.read_bytes() == path.read_bytes()
    return Defect("stray_name", f"{'the same bytes as' if same else 'different content from'} {regular.name}")


def lint_pictures(root: Path) -> Report:
    """Validate every label file with a picture of the same name, by the size of the picture.

    A line may be a box, a detection or a polygon, which is converted to the box around it.
    """
    root = Path(root)
    pictures, labels = _pictures(root), _labels(root)
    if not labels:
        raise FormatError(f"no label file (*.txt): found {suffix_counts(root)}", path=root)
    findings = Findings(root)
    names = cache(class_lists.class_names)
    boxes = 0
    for stem in sorted(set(pictures) - set(labels)):
        findings.add(pictures[stem], Defect("missing_labels"))
    for stem, path in track(sorted(labels.items()), "validating labels"):
        if stem not in pictures:
            findings.add(path, Defect("missing_picture"))
            continue
        size = findings.read(pictures[stem], png.size, "unreadable_picture")
        if size is None:
            continue
        reader = partial(yolo.read_boxes, size=size, names=names(path.parent), detections=True, polygons=True)
        content = findings.read(path, reader, "malformed")
        if content is not None:
            boxes += len(content[0])
            for defect in box_defects(*content, size):
                findings.add(path, defect)
    return Report(
        sorted(findings.gathered), {"folder": {"pictures": len(pictures), "label_files": len(labels), "boxes": boxes}}
    )


def _pictures(root: Path) -> dict[str, Path]:
    return _by_stem(root, (path for path in root.rglob("*") if path.suffix.lower() in png.SUFFIXES), IMAGES)


def _labels(root: Path) -> dict[str, Path]:
    texts = (path for path in root.rglob("*.txt") if not class_lists.is_class_list(path) and path.is_file())
    return _by_stem(root, texts, LABELS)


def _by_stem(root: Path, files: Iterable[Path], names: tuple[str, ...]) -> dict[str, Path]:
    """Return files by path without suffix and folders of these names; if some are in such folders, only these."""
    folders = {path: path.relative_to(root).parts[:-1] for path in sorted(files)}
    inside = [path for path in folders if not set(folders[path]).isdisjoint(names)] or list(folders)
    return {"/".join([*(part for part in folders[path] if part not in names), path.stem]): path for path in inside}


def lint_folder(
    root: Path, names: Collection[str], *, site: Site | None = None, workers: int = 1, fix: Path | None = None
) -> Report:
    """Return the findings of some rules in a folder of label files, see `layout_of`.

    `site` is the site of the photos, NASA's POLAR by default; the folder of a run states its site. `fix` is the output
    folder of repaired label files; only for the published layout.
    """
    root = existing_folder(root)
    if release.RUN_LAYOUT.terrains(root / "labels", PhotoKey.parse):  # the folder of a run
        site = site or Run(root).site
        root /= "labels"
    site = site or polar()
    layout = layout_of(root, site)
    if fix is not None and layout != release.PUBLISHED_LAYOUT:
        raise FormatError(f"only the published layout can be repaired, with a folder {release.BOXES}", path=root)
    report = lint_pictures(root) if layout is None else lint_release(root, workers, layout, site)
    report = report.chosen(names)
    return report if fix is None else replace(report, repairs=write_repaired(root, report.findings, fix, names, site))


def layout_of(root: Path, site: Site) -> Layout | None:
    """Return the layout of a folder of label files; None for label files with pictures."""
    if release.terrains(root):
        return release.PUBLISHED_LAYOUT
    for layout in (release.RUN_LAYOUT, release.TERRAIN_LAYOUT):
        if layout.terrains(root, site.key):
            return layout
    if _pictures(root):
        return None
    if release.FLAT_LAYOUT.terrains(root, site.key):
        return release.FLAT_LAYOUT
    raise FormatError(
        f"no terrain and no picture with labels: found {suffix_counts(root)}; "
        f"expected {release.BOXES}/TerrainNN/KEY.txt"
        ", TerrainNN/KEY.txt, KEY.txt, or pictures and label files of equal names in images/ and labels/ or together",
        path=root,
    )


def rule_lines() -> list[str]:
    """Return a line for each rule, by code."""
    rows = sorted((rule.code, rule.severity, name, rule) for name, rule in RULES.items())
    return [
        f"{code}  {severity:7}  {name:22}  {rule.meaning}" + (f"; --fix {rule.repair}" if rule.repair else "")
        for code, severity, name, rule in rows
    ]

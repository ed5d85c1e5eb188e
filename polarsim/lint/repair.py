"""Repair of label files in a published folder, by rules that need no person."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import class_lists, release, tables, yolo
from polarsim.formats.files import text_of, writing_folder
from polarsim.geometry.boxes import clip
from polarsim.lint.files import (
    BACKGROUND,
    GROUND,
    ROCK_CLASS,
    SHADOW_CLASS,
    Boxes,
    Polygons,
    Size,
    box_defects,
    file_defects,
    ring_defects,
)
from polarsim.lint.findings import Finding, Report
from polarsim.lint.rules import RULES, Defect
from polarsim.lint.siblings import modal_file, of_class, set_defects, swapped_classes
from polarsim.photo import BOX_CLASSES, PhotoKey, Terrain, by_bracket
from polarsim.progress import track
from polarsim.site import Site, polar

REPAIR_TABLE = "changes.csv"
_LABELS = (release.BOXES, release.POLYGONS)  # copied folders
_LEFT_OUT = ("stray_name", "system_file", "wrong_folder")
_OF_SET = {
    ROCK_CLASS: ("missing_file", "empty_file", "rock_missing", "rock_extra", "rock_moved"),
    SHADOW_CLASS: (
        "missing_file", "empty_file", "shadow_missing", "shadow_extra", "shadow_moved", "shadows_off_late",
    ),
}  # fmt: skip
_LOSSY = ("malformed", "near_duplicate")  # repairs that may remove a correct box or keep a wrong one
_ROUNDS = 8  # maximum number of repetitions for defects that repairs reveal; two or three are enough


def write_repaired(
    root: Path, findings: Iterable[Finding], out: Path, names: Collection[str] = RULES, site: Site | None = None
) -> int:
    """Copy the label files of a published folder, repair its findings, and list the repairs in `changes.csv`.

    Return the number of repaired findings. Other files of the folder, such as photos, scans and meshes, are not copied.
    `names` are the rules that are also repaired if an earlier repair reveals their defects, such as a repeated box in a
    file with a malformed line. `site` is the site of the photos, NASA's POLAR by default.
    """
    if out.exists() or out.resolve().is_relative_to(root.resolve()):
        raise FormatError(f"a repaired copy needs a new folder outside {root}", path=out)
    by_file: dict[str, list[Finding]] = {}
    for finding in findings:
        if finding.repair and Path(finding.file).parts[0] in _LABELS:
            by_file.setdefault(finding.file, []).append(finding)
    for terrain in release.terrains(root):
        classes = class_lists.find_classes(release.label_folder(root, terrain))
        if tuple(name.strip().lower() for name in classes.names[: len(BOX_CLASSES)]) != BOX_CLASSES:
            raise FormatError(f"classes {classes}, repairs need 0 rock, 1 shadow", path=classes.path)
    with writing_folder(out) as copy:
        for name in _LABELS:
            if (root / name).is_dir():
                shutil.copytree(root / name, copy / name, ignore=shutil.ignore_patterns(release.SNAKEMAKE_FILE))
        repairs = _Repairs(copy, site or polar(), by_file, {name for name in names if RULES[name].repair})
        repairs.files()
        for terrain in track(release.terrains(copy), "repairing terrains"):
            repairs.boxes(terrain)
            repairs.polygons(terrain)
        report = Report(sorted(repairs.done), {})
        tables.write_csv(copy / REPAIR_TABLE, report.table("file", "line", "code", "defect", "repair", "detail"))
    return len(report.findings)


@dataclass
class _Repairs:
    """Repairs of a copy, and the findings that they resolve."""

    copy: Path
    site: Site
    by_file: Mapping[str, Sequence[Finding]]
    names: set[str]  # names of rules with a repair
    done: list[Finding] = field(default_factory=list)

    def files(self) -> None:
        """Omit files with wrong names; rename impossible exposures to the nearest exposure without a file."""
        for file, findings in self.by_file.items():
            path = self.copy / file
            for finding in findings:
                if finding.defect in _LEFT_OUT:
                    path.unlink()
                elif finding.defect == "impossible_exposure":
                    regular = path.with_name(f"{self._possible(PhotoKey.parse(path.stem))}{path.suffix}")
                    path.unlink() if regular.exists() else path.rename(regular)
                else:
                    continue
                self.done.append(finding)

    def _possible(self, key: PhotoKey) -> PhotoKey:
        """Return the photo with the exposure of the site that is nearest to an impossible one, in stops."""
        exposures = self.site.exposures_of(key.terrain, key.azimuth)
        return key.with_exposure(min(exposures, key=lambda exposure: abs(np.log2(exposure / key.exposure_ms))))

    def boxes(self, terrain: Terrain) -> None:
        """Repair the label files of a terrain.

        Files are repaired separately before the majority of their bracket determines the content of the rest, so that
        a defect of most exposures does not spread. A file that may have lost a box has no vote if others have one.
        """
        folder = release.label_folder(self.copy, terrain)
        paths = release.label_files(self.copy, terrain, self.site.key)
        read_boxes = partial(yolo.read_boxes, size=self.site.images.size)
        open_findings = self._open_findings(folder)
        doubtful = {
            key for key, separate in open_findings.items() if any(finding.defect in _LOSSY for finding in separate)
        }
        for key in paths:
            if any(finding.defect == "malformed" for finding in open_findings.get(key, ())):
                _drop_malformed(paths[key], read_boxes)
        labels = {key: read_boxes(path) for key, path in paths.items()}
        before, missing = dict(labels), set(open_findings) - set(labels)
        for number in range(_ROUNDS):
            separate = list(self._defects_of_files(labels))
            for key, defect in separate:
                doubtful |= {key} if defect.name in _LOSSY else set()
            for key in {key for key, _ in separate}:
                defects = [defect for name, defect in separate if name == key]
                labels[key] = _repaired_boxes(labels[key], defects, self.site.images.size)
            of_set = list(self._set_defects(labels, missing, set() if number else doubtful))
            self.done += self._revealed(folder, open_findings, [*separate, *of_set])
            if not separate and not of_set:
                break
            missing = set()
        for key, content in labels.items():
            if key not in before or not _equal(content, before[key]):
                yolo.write_boxes(folder / f"{key}.txt", *content, self.site.images.size)
        self.done += [finding for key in open_findings for finding in open_findings[key]]

    def _defects_of_files(self, labels: Mapping[PhotoKey, Boxes]) -> Iterator[tuple[PhotoKey, Defect]]:
        for key, content in labels.items():
            defects = box_defects(*content, self.site.images.size)
            yield from ((key, defect) for defect in defects if defect.name in self.names)
        if "swapped_class" in self.names:
            for view in sorted({key.view for key in labels}):
                yield from swapped_classes({key: content for key, content in labels.items() if key.view == view})

    def _set_defects(
        self, labels: dict[PhotoKey, Boxes], missing: set[PhotoKey], doubtful: set[PhotoKey]
    ) -> Iterator[tuple[PhotoKey, Defect]]:
        """Replace defective and missing files by the modal content of their bracket; yield the defects."""
        for keys in by_bracket({*labels, *missing}).values():
            files = {key: labels[key] for key in keys if key in labels}
            voters = {key: content for key, content in files.items() if key not in doubtful} or files
            names = {key: {"missing_file"} for key in missing.intersection(keys)}
            for key, defect in set_defects(files, voters):
                if defect.name in self.names:
                    names.setdefault(key, set()).add(defect.name)
                    yield key, defect
            for key, defects in names.items():
                labels[key] = _as_modal(files.get(key, _NO_BOXES), key, voters, defects)

    def _revealed(
        self,
        folder: Path,
        open_findings: Mapping[PhotoKey, Sequence[Finding]],
        defects: Iterable[tuple[PhotoKey, Defect]],
    ) -> list[Finding]:
        """Return findings of defects that were revealed by repairs."""
        below = folder.relative_to(self.copy)
        known = {(finding.file, finding.defect) for finding in (*self.done, *itertools.chain(*open_findings.values()))}
        files = [((below / f"{key}.txt").as_posix(), defect) for key, defect in defects]
        new = {(file, defect.name): defect.detail for file, defect in files if (file, defect.name) not in known}
        return [Finding(file, 0, name, detail) for (file, name), detail in new.items()]

    def polygons(self, terrain: Terrain) -> None:
        """Repair the polygon files of a terrain."""
        size = self.site.images.size
        read_polygons = partial(yolo.read_polygons, size=size)
        for key, findings in self._open_findings(release.polygon_folder(self.copy, terrain)).items():
            path = release.polygon_folder(self.copy, terrain) / f"{key}.txt"
            if any(finding.defect == "malformed" for finding in findings):
                _drop_malformed(path, read_polygons)
            polygons = read_polygons(path)
            for _ in range(_ROUNDS):
                defects = [*ring_defects(polygons, size), *file_defects(polygons, size)]
                if self.names.isdisjoint(defect.name for defect in defects):
                    break
                repaired = [defect for defect in defects if defect.name in self.names]
                polygons = _repaired_polygons(polygons, repaired, size)
            yolo.write_polygons(path, polygons, size)
            self.done += findings

    def _open_findings(self, folder: Path) -> dict[PhotoKey, list[Finding]]:
        """Return the findings of a folder's label files that are not repaired yet."""
        below = folder.relative_to(self.copy).as_posix()
        done = set(self.done)
        paths = {file: Path(file) for file in self.by_file if Path(file).parent.as_posix() == below}
        keys = {file: release.key_of_file(path.name, self.site.key) for file, path in paths.items()}
        remaining = {
            key: [finding for finding in self.by_file[file] if finding not in done] for file, key in keys.items() if key
        }
        return {key: findings for key, findings in remaining.items() if findings}


_NO_BOXES: Boxes = (np.zeros(0, int), np.zeros((0, 4)))


def _drop_malformed(path: Path, reader: Callable[[Path], Any]) -> None:
    """Remove unreadable lines of a file; all lines of a file that is not text."""
    while True:
        try:
            reader(path)
        except FormatError as error:
            lines = [] if error.line is None else text_of(path).split("\n")
            malformed = {one.line for one in (error.lines if isinstance(error, yolo.MalformedLinesError) else [error])}
            kept = [line for number, line in enumerate(lines, 1) if number not in malformed]
            if error.line is not None and kept == lines:  # the line does not exist: prevents an endless loop
                raise
            path.write_text("\n".join(kept), encoding="utf-8")
        else:
            return


def _equal(one: Boxes, other: Boxes) -> bool:
    return all(np.array_equal(first, second) for first, second in zip(one, other, strict=True))


def _repaired_boxes(labels: Boxes, defects: Sequence[Defect], size: Size) -> Boxes:
    """Remove duplicates, change swapped classes, and clip boxes at the image border."""
    classes, boxes = labels[0].copy(), labels[1]
    rows = {defect.name: list(defect.rows) for defect in defects}
    classes[rows.get("swapped_class", [])] = ROCK_CLASS
    if "out_of_photo" in rows:
        boxes = clip(boxes, *size)
    kept = np.asarray((boxes[:, 2:] > boxes[:, :2]).all(axis=1))
    kept[rows.get("duplicate", []) + rows.get("near_duplicate", [])] = False
    return classes[kept], boxes[kept]


def _as_modal(labels: Boxes, key: PhotoKey, voters: Mapping[PhotoKey, Boxes], names: set[str]) -> Boxes:
    """Replace boxes of the defective classes by those of most voters of the exposure bracket.

    Missing and empty files only get shadows if a shorter or equal exposure has shadows.
    """
    classes, boxes = labels
    for number, of_set in _OF_SET.items():
        if names.isdisjoint(of_set):
            continue
        known = of_class(voters, number)
        shown = min((other.exposure_ms for other in known), default=key.exposure_ms) <= key.exposure_ms
        wanted = boxes[:0]
        if known and (number == ROCK_CLASS or shown):
            wanted = known[modal_file(known)]
        other = classes != number
        classes = np.concatenate([classes[other], np.full(len(wanted), number)])
        boxes = np.concatenate([boxes[other], wanted])
    return classes, boxes


def _repaired_polygons(polygons: Polygons, defects: Sequence[Defect], size: Size) -> Polygons:
    """Make outlines valid, clip them at the image border, omit small components, and paint ground first."""
    rows = {defect.name: set(defect.rows) for defect in defects}
    dropped = rows.get("tiny_polygon", set()) | rows.get("thin_polygon", set())
    reshaped = rows.get("invalid_ring", set()) | rows.get("out_of_photo", set())
    repaired: Polygons = []
    for number, (kind, vertices) in enumerate(polygons):
        if number in dropped:
            continue
        ring = _valid(vertices, size) if number in reshaped else vertices
        if ring is not None:
            repaired.append((GROUND if number in rows.get("ground_as_rock", ()) else kind, ring))
    if "paint_order" in rows:
        repaired.sort(
            key=lambda polygon: (GROUND, BACKGROUND).index(polygon[0]) if polygon[0] in (GROUND, BACKGROUND) else 2
        )
    return repaired


def _valid(vertices: np.ndarray, size: Size) -> np.ndarray | None:
    """Return the largest valid part (n, 2) of an outline inside the photo; None if nothing remains."""
    import shapely

    clipped = shapely.intersection(shapely.make_valid(shapely.Polygon(vertices)), shapely.box(0, 0, *size))
    parts = [part for part in shapely.get_parts(clipped) if part.geom_type == "Polygon"]
    largest = max(parts, key=lambda part: part.area, default=None)
    return None if largest is None else np.array(largest.exterior.coords)[:-1]

"""Defects relative to other photos of the same scene: other exposures, azimuths and lights, and the other camera.

Only the exposure changes within an exposure bracket, so that labels should be equal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import iou, largest_iou, match_by_summed_iou
from polarsim.geometry.consensus import MIN_SAME_ROCK_IOU, find_rocks_labelled_shadow
from polarsim.lint.files import ROCK_CLASS, SHADOW_CLASS, Boxes
from polarsim.lint.rules import Defect
from polarsim.photo import BOX_CLASSES, NO_SUN, Bracket, PhotoKey, by_bracket
from polarsim.site import Site

MIN_SAME_IOU, MIN_UNMOVED_IOU = 0.1, 0.9  # minimum IoU of the same box in another exposure, and of an unmoved box
Defects = Iterator[tuple[PhotoKey, Defect]]


def set_defects(files: Mapping[PhotoKey, Boxes], voters: Mapping[PhotoKey, Boxes] | None = None) -> Defects:
    """Yield defects of an exposure bracket, relative to the content of most voters (default: all)."""
    voters = files if voters is None else voters
    filled = {key: boxes for key, boxes in files.items() if len(boxes[0])}
    if filled:
        for key in sorted(set(files) - set(filled)):
            yield key, Defect("empty_file", f"{len(filled)} other exposures have boxes")
    for number in (ROCK_CLASS, SHADOW_CLASS):
        yield from _against_modal(files, number, modal(of_class(voters, number)))
    shortest_with_shadows: PhotoKey | None = None
    for key in sorted(files, key=lambda key: key.exposure_ms):
        shadows = int((files[key][0] == SHADOW_CLASS).sum())
        if shortest_with_shadows and not shadows:
            yield key, Defect("shadows_off_late", f"no shadow, but some at {shortest_with_shadows.exposure_ms} ms")
        elif shadows and not shortest_with_shadows:
            shortest_with_shadows = key


def missing_exposures(existing: set[PhotoKey], site: Site) -> list[PhotoKey]:
    """Return missing photos of a nearly complete exposure bracket with Sun; empty if most of the bracket is missing."""
    key = next(iter(existing))
    complete = {key.with_exposure(exposure) for exposure in site.exposures_of(key.terrain, key.azimuth)}
    missing = complete - existing
    return sorted(missing) if key.has_sun and len(missing) < len(complete) / 2 else []


def of_class(files: Mapping[PhotoKey, Boxes], number: int) -> dict[PhotoKey, np.ndarray]:
    """Return boxes (n, 4) of a class in files with boxes; short exposures without any shadow are excluded."""
    boxes = {key: rows[classes == number] for key, (classes, rows) in files.items() if len(classes)}
    return {key: kept for key, kept in boxes.items() if len(kept) or number == ROCK_CLASS}


def modal(boxes: Mapping[PhotoKey, np.ndarray]) -> np.ndarray:
    """Return the most frequent content (n, 4); of equally frequent, the one with fewest boxes and shortest exposure."""
    return np.array(_content(boxes[modal_file(boxes)])).reshape(-1, 4) if boxes else np.zeros((0, 4))


def modal_file(boxes: Mapping[PhotoKey, np.ndarray]) -> PhotoKey:
    """Return the shortest exposure among the files with the modal content; there must be at least one file."""
    contents = {key: _content(boxes[key]) for key in sorted(boxes)}
    times = Counter(contents.values())
    return max(contents, key=lambda key: (times[contents[key]], -len(contents[key])))  # the first of equals


def _content(boxes: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """Return boxes (n, 4) rounded to 0.1 px, in an order that is independent of the file."""
    return tuple(sorted(map(tuple, (np.round(boxes, 1) + 0.0).tolist())))


def modals(boxes: Mapping[PhotoKey, np.ndarray]) -> dict[Bracket, np.ndarray]:
    """Return the modal content (n, 4) of each exposure bracket."""
    return {name: modal({key: boxes[key] for key in keys}) for name, keys in by_bracket(boxes).items()}


def _against_modal(files: Mapping[PhotoKey, Boxes], number: int, common: np.ndarray) -> Defects:
    """Yield defects of boxes of a class that are missing, additional or moved relative to the common ones (n, 4)."""
    of_kind, kind = of_class(files, number), BOX_CLASSES[number]
    for key, here in of_kind.items():
        change = changed_boxes(common, here)
        rows = np.flatnonzero(files[key][0] == number)
        for name, wrong, wanted in (
            ("missing", (), change.missing),
            ("extra", change.extra, ()),
            ("moved", change.moved, change.moved_from),
        ):
            if len(wrong) or len(wanted):
                detail = f"{max(len(wrong), len(wanted))} of {len(common)}"
                lacking = tuple(tuple(box) for box in np.reshape(wanted, (-1, 4)).tolist())
                yield key, Defect(f"{kind}_{name}", detail, tuple(rows[list(wrong)].tolist()), lacking)


@dataclass(frozen=True)
class Change:
    """Differences of boxes: missing boxes (k, 4), added rows, moved rows and their previous boxes."""

    missing: np.ndarray
    extra: np.ndarray
    moved: np.ndarray
    moved_from: np.ndarray


def changed_boxes(before: np.ndarray, after: np.ndarray) -> Change:
    """Compare boxes `before` (n, 4) and `after` (m, 4)."""
    overlap = iou(before, after)
    rows, columns = match_by_summed_iou(overlap)
    same = overlap[rows, columns] > MIN_SAME_IOU
    rows, columns = rows[same], columns[same]
    off = overlap[rows, columns] < MIN_UNMOVED_IOU
    return Change(
        np.delete(before, rows, axis=0),
        np.setdiff1d(np.arange(len(after)), columns),
        columns[off],
        before[rows[off]],
    )


def sibling_defects(files: Mapping[PhotoKey, Boxes], site: Site) -> Defects:
    """Yield defects of the files of a terrain, relative to files under other lamps."""
    yield from _copies(files)
    yield from _missing_right(files)
    for view in sorted({key.view for key in files}):
        mine = {key: boxes for key, boxes in files.items() if key.view == view}
        yield from _across_azimuths(mine, len(site.suns))
        yield from _across_lights(mine)


def _copies(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Yield files of a view with the same content under two Sun lamps."""
    same: dict[tuple[object, ...], list[PhotoKey]] = {}
    for key, (classes, boxes) in sorted(files.items()):
        if len(classes):
            rows = sorted(zip(classes.tolist(), map(tuple, np.round(boxes, 1).tolist()), strict=True))
            same.setdefault((key.view, *rows), []).append(key)
    for keys in same.values():
        for key in keys:
            other = next((candidate for candidate in keys if candidate.azimuth != key.azimuth), None)
            if other is not None:
                yield key, Defect("copied_azimuth", f"the same as {other}")


def _missing_right(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Yield labelled left photos without Sun and without labels of the right photo, if the right set has labels."""
    right = {key for key in files if key.camera == "R"}
    sets = {(key.position, key.light) for key in right if not key.has_sun}
    for key in sorted(files):
        left = not key.has_sun and key.camera == "L" and (key.position, key.light) in sets
        if left and key.other_camera not in right:
            yield key, Defect("missing_right", f"no {key.other_camera}")


def _across_azimuths(files: Mapping[PhotoKey, Boxes], suns: int) -> Defects:
    """Yield defects of a view relative to the best files of the other azimuths, rover light off.

    `suns` is the number of Sun lamps of the site. With fewer than three, no majority of lamps is possible.
    """
    best, rocks = _dark_rocks(files)
    for azimuth, key in best.items():
        others = [rocks[other] for other in rocks if other != azimuth]
        if len(others) < max(2, suns - 1):
            continue
        elsewhere = np.all([largest_iou(others[0], other) >= MIN_SAME_ROCK_IOU for other in others[1:]], axis=0)
        absent = int((elsewhere & (largest_iou(others[0], rocks[azimuth]) < MIN_SAME_ROCK_IOU)).sum())
        alone = int(np.all([largest_iou(rocks[azimuth], other) < MIN_SAME_ROCK_IOU for other in others], axis=0).sum())
        if absent:
            yield key, Defect("rock_absent", f"{absent} rocks")
        if alone:
            yield key, Defect("rock_alone", f"{alone} rocks")
    yield from swapped_classes(files)


def swapped_classes(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Yield shadows of a view that are rocks in the best files of other azimuths, rover light off."""
    _, rocks = _dark_rocks(files)
    for key, (classes, boxes) in sorted(files.items()):
        shadows = np.flatnonzero(classes == SHADOW_CLASS)
        elsewhere = [rocks[azimuth] for azimuth in rocks if azimuth != key.azimuth]
        swapped = shadows[find_rocks_labelled_shadow(boxes[shadows], boxes[classes == ROCK_CLASS], elsewhere)]
        if len(swapped):
            detail = f"{len(swapped)} boxes, first box {swapped[0] + 1}"
            yield key, Defect("swapped_class", detail, tuple(swapped.tolist()))


def _dark_rocks(files: Mapping[PhotoKey, Boxes]) -> tuple[dict[str, PhotoKey], dict[str, np.ndarray]]:
    """Return the best file of a view with rover light off and its rocks (n, 4), by Sun azimuth."""
    best: dict[str, PhotoKey] = {key.azimuth: key for key in _best(files) if key.light == "off" and key.has_sun}
    return best, {azimuth: files[key][1][files[key][0] == ROCK_CLASS] for azimuth, key in best.items()}


def _across_lights(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Yield differences between rover light on and off, for the best file of each exposure bracket."""
    sets = {name: {key: files[key] for key in keys} for name, keys in by_bracket(files).items()}
    best = {key.bracket: key for key in _best(files)}
    for name, lit in sets.items():
        terrain, position, light, azimuth, camera = name
        dark = sets.get((terrain, position, "off", azimuth, camera))
        if light != "on" or azimuth == NO_SUN or dark is None:
            continue
        for number, kind in ((ROCK_CLASS, "rock"), (SHADOW_CLASS, "shadow")):
            before, after = modal(of_class(dark, number)), modal(of_class(lit, number))
            if not len(before) or not len(after):
                continue
            if len(before) != len(after):
                yield best[name], Defect(f"light_{kind}s_differ", f"{len(after)}, off: {len(before)}")
            moved = len(changed_boxes(before, after).moved)
            if moved:
                yield best[name], Defect(f"light_{kind}_moved", f"{moved} of {len(before)}")


def _best(files: Mapping[PhotoKey, Boxes]) -> list[PhotoKey]:
    """Return the file with most boxes of each exposure bracket; of equal files the shortest exposure."""
    return [max(keys, key=lambda key: (len(files[key][0]), -key.exposure_ms)) for keys in by_bracket(files).values()]

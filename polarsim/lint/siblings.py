"""What other azimuths, lights and the other camera of a station show of the same scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from polarsim.geometry.boxes import largest_iou
from polarsim.geometry.swapped import SAME_ROCK, rocks_called_shadows
from polarsim.lint.boxes import ROCK_CLASS, SHADOW_CLASS, Boxes
from polarsim.lint.exposures import Found, brackets, changed, modal, of_class
from polarsim.lint.rules import Defect
from polarsim.photo import SUNS, PhotoKey


def sibling_defects(files: Mapping[PhotoKey, Boxes]) -> Found:
    """Defects of the files of one terrain, against files under other lamps."""
    yield from _copied(files)
    yield from _without_right(files)
    for view in sorted({key.view for key in files}):
        mine = {key: boxes for key, boxes in files.items() if key.view == view}
        yield from _across_azimuths(mine)
        yield from _across_lights(mine)


def _copied(files: Mapping[PhotoKey, Boxes]) -> Found:
    """Files of one view with the same content under two Sun lamps."""
    same: dict[tuple[object, ...], list[PhotoKey]] = {}
    for key, (classes, boxes) in sorted(files.items()):
        if len(classes):
            rows = sorted(zip(classes.tolist(), map(tuple, np.round(boxes, 1).tolist()), strict=True))
            same.setdefault((key.view, *rows), []).append(key)
    for keys in same.values():
        for key in keys:
            other = next((one for one in keys if one.azimuth != key.azimuth), None)
            if other is not None:
                yield key, Defect("copied_azimuth", f"the same as {other}")


def _without_right(files: Mapping[PhotoKey, Boxes]) -> Found:
    """Left photos without Sun that are labelled while their Right is not, though the Right set is there."""
    right = {key for key in files if key.camera == "R"}
    sets = {(key.position, key.light) for key in right if key.azimuth == "no"}
    for key in sorted(files):
        if key.azimuth == "no" and key.camera == "L" and (key.position, key.light) in sets:
            twin = replace(key, camera="R")
            if twin not in right:
                yield key, Defect("missing_right", f"no {twin}")


def _across_azimuths(files: Mapping[PhotoKey, Boxes]) -> Found:
    """Rocks and classes of one view against the best files of the other azimuths, rover light off."""
    best = {key.azimuth: key for key in _best(files) if key.light == "off" and key.azimuth in SUNS}
    rocks = {azimuth: _rocks(files[key]) for azimuth, key in best.items()}
    for azimuth, key in best.items():
        others = [rocks[other] for other in rocks if other != azimuth]
        if len(others) < len(SUNS) - 1:
            continue
        elsewhere = np.all([largest_iou(others[0], other) >= SAME_ROCK for other in others[1:]], axis=0)
        absent = int((elsewhere & (largest_iou(others[0], rocks[azimuth]) < SAME_ROCK)).sum())
        alone = int(np.all([largest_iou(rocks[azimuth], other) < SAME_ROCK for other in others], axis=0).sum())
        if absent:
            yield key, Defect("rock_absent", f"{absent} rocks")
        if alone:
            yield key, Defect("rock_alone", f"{alone} rocks")
    for key, (classes, boxes) in sorted(files.items()):
        shadows = np.flatnonzero(classes == SHADOW_CLASS)
        elsewhere = [rocks[azimuth] for azimuth in rocks if azimuth != key.azimuth]
        swapped = shadows[rocks_called_shadows(boxes[shadows], boxes[classes == ROCK_CLASS], elsewhere)]
        if len(swapped):
            detail = f"{len(swapped)} boxes, first box {swapped[0] + 1}"
            yield key, Defect("swapped_class", detail, tuple(swapped.tolist()))


def _across_lights(files: Mapping[PhotoKey, Boxes]) -> Found:
    """Exposure brackets of one view with the rover light on, against the same ones with it off; named by their best
    file.
    """
    sets = {keys[0].bracket: {key: files[key] for key in keys} for keys in brackets(files)}
    best = {key.bracket: key for key in _best(files)}
    for name, lit in sets.items():
        terrain, position, light, azimuth, camera = name
        dark = sets.get((terrain, position, "off", azimuth, camera))
        if light != "on" or azimuth == "no" or dark is None:
            continue
        for number, kind in ((ROCK_CLASS, "rock"), (SHADOW_CLASS, "shadow")):
            before, after = modal(of_class(dark, number)), modal(of_class(lit, number))
            if not len(before) or not len(after):
                continue
            if len(before) != len(after):
                yield best[name], Defect(f"light_{kind}s_differ", f"{len(after)}, off: {len(before)}")
            moved = len(changed(before, after).moved)
            if moved:
                yield best[name], Defect(f"light_{kind}_moved", f"{moved} of {len(before)}")


def _best(files: Mapping[PhotoKey, Boxes]) -> list[PhotoKey]:
    """The file with most boxes of each exposure bracket, the shortest exposure of equals."""
    return [max(keys, key=lambda key: (len(files[key][0]), -key.exposure_ms)) for keys in brackets(files)]


def _rocks(labels: Boxes) -> np.ndarray:
    classes, boxes = labels
    return boxes[classes == ROCK_CLASS]

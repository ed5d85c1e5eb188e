"""What geometry and light allow: boxes of another view, stereo pairs off their line, shadows on the Sun's side."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim import survey
from polarsim.geometry.boxes import centres, iou, match_sum
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.poses import surveyed_pose
from polarsim.geometry.stereo import StereoRig, stated_rig
from polarsim.lint.files import ROCK_CLASS, SHADOW_CLASS, Boxes
from polarsim.lint.rules import Defect
from polarsim.lint.siblings import Defects, modals, of_class
from polarsim.photo import CAMERAS, HEIGHT, SUNS, Bracket, PhotoKey

LEAST_BOXES = 3  # fewer tell no view
BETTER, GOOD = 0.25, 0.4  # mean IoU by which another view must fit better, and at least
OFFSETS_PX = np.arange(-320, 1, 4)  # Left to Right at the photo's centre that are tried
SLOPE, DROP_PX = -0.18, 15.5  # offset per row, and rows that Right lies below Left: the release's rig
ROUNDS = 3  # of fitting the offset as a plane
NEAR_PX = 40.0  # boxes further from where the plane has them are no pair
LEAST_PAIRS = 6  # that a plane is fitted to
ACROSS_PX, OFF_PX = 25.0, 15.0  # a rock off its line: near across, and so many rows off
ALIKE = 0.4  # largest log ratio of the sides of one rock's boxes in Left and Right
ROCK_FOOT, SHADOW_FOOT = 0.75, 0.5  # share of a box's height, from its top, at which a thing's centre meets the ground
REACH = 0.12  # metres on the ground between a rock's box and its shadow's
AWAY, TOWARDS = 0.0, -0.7  # cosine to the direction of light: from there on a shadow may be, and cannot be, a rock's


def view_defects(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Defects of the files of one terrain that need more than one view, or the positions of cameras and lamps."""
    yield from _of_other_views(files)
    yield from _of_other_azimuths(files)
    yield from _off_epipolar(files)
    yield from _sunward(files)


def _of_other_views(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Rocks of a file against the exposure brackets of all views, its own set left out; the median over sets counts."""
    rocks = of_class(files, ROCK_CLASS)
    sets = modals(rocks)
    fits: dict[tuple[object, ...], dict[tuple[int, str, str], float]] = {}
    for key, boxes in sorted(rocks.items()):
        if len(boxes) < LEAST_BOXES:
            continue
        content = (key.bracket, boxes.tobytes())
        if content not in fits:  # most exposures have the same
            fits[content] = _fits_of_views(
                boxes, {name: annotated for name, annotated in sets.items() if name != key.bracket}
            )
        found = fits[content]
        best = max(found, key=lambda view: found[view], default=None)
        own = found.get(key.view)
        if best is not None and own is not None and found[best] >= max(GOOD, own + BETTER):
            detail = f"rocks of {best[1]} {best[2]}: mean IoU {found[best]:.2f}, own {own:.2f}"
            yield key, Defect("other_view", detail)


def _fits_of_views(boxes: np.ndarray, sets: Mapping[Bracket, np.ndarray]) -> dict[tuple[int, str, str], float]:
    fits: dict[tuple[int, str, str], list[float]] = {}
    for name, annotated in sets.items():
        fits.setdefault(_view(name), []).append(_fit(boxes, annotated))
    return {view: float(np.median(found)) for view, found in fits.items()}


def _of_other_azimuths(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Shadows of an exposure bracket against those under the same lamp with the other light, and under other lamps."""
    shadows = of_class(files, SHADOW_CLASS)
    sets = modals(shadows)
    for key, boxes in sorted(shadows.items()):
        if key.azimuth not in SUNS or len(boxes) < LEAST_BOXES:
            continue
        other = {
            name[3]: _fit(boxes, annotated)
            for name, annotated in sets.items()
            if _view(name) == key.view and name[3] in SUNS and name[2] != key.light
        }
        own = other.pop(key.azimuth, None)
        best = max(other, key=lambda azimuth: other[azimuth], default=None)
        if own is not None and best is not None and other[best] >= max(GOOD, own + BETTER):
            yield key, Defect("other_azimuth", f"shadows of azimuth {best}: mean IoU {other[best]:.2f}, own {own:.2f}")


def _view(bracket: Bracket) -> tuple[int, str, str]:
    terrain, position, _, _, camera = bracket
    return terrain, position, camera


def _fit(boxes: np.ndarray, known: np.ndarray) -> float:
    """Mean IoU of boxes (n, 4) with known ones."""
    overlap = iou(boxes, known)
    return float(overlap[match_sum(overlap)].sum() / max(1, len(boxes)))


def _off_epipolar(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Rocks of a Right file that lie above or below where all pairs of the station put the Left one."""
    rocks = of_class(files, ROCK_CLASS)
    sets = modals(rocks)
    for station in sorted({key.station for key in rocks}):
        seen = {
            camera: consensus_boxes([boxes for name, boxes in sets.items() if _view(name) == (*station, camera)])
            for camera in CAMERAS
        }
        plane = _right_from_left(seen["L"], seen["R"])
        if plane is None:
            continue
        for key in sorted(key for key in rocks if (key.station, key.camera) == (station, "R")):
            if key.other_camera in rocks:
                rows = _off_line(_moved(rocks[key.other_camera], plane), rocks[key])
                if rows:
                    yield key, Defect("off_epipolar", f"{len(rows)} rocks, first box {rows[0] + 1} of the rocks")


def _right_from_left(left: np.ndarray, right: np.ndarray) -> np.ndarray | None:
    """(3, 2) offset of a box's centre as a plane over the Left photo; None where too few boxes pair."""
    if min(len(left), len(right)) < LEAST_PAIRS:
        return None
    starts = [np.array([[a - SLOPE * HEIGHT / 2, DROP_PX], [0, 0], [SLOPE, 0]]) for a in OFFSETS_PX]
    plane = max(starts, key=lambda start: _fit(_moved(left, start), right))
    for _ in range(ROUNDS):
        moved = _moved(left, plane)
        overlap = iou(moved, right)
        rows, columns = match_sum(overlap)
        near = np.linalg.norm(centres(moved[rows]) - centres(right[columns]), axis=1) < NEAR_PX
        rows, columns = rows[near], columns[near]
        if len(rows) < LEAST_PAIRS:
            return None
        plane = np.linalg.lstsq(_terms(left[rows]), centres(right[columns]) - centres(left[rows]), rcond=None)[0]
    return plane


def _terms(boxes: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(boxes)), centres(boxes)])


def _moved(boxes: np.ndarray, plane: np.ndarray) -> np.ndarray:
    return np.asarray(boxes + np.tile(_terms(boxes) @ plane, 2))


def _off_line(expected: np.ndarray, right: np.ndarray) -> list[int]:
    """Rows of Right boxes that fit no expected one, but the size and column of one that nothing fits."""
    overlap = iou(expected, right)
    free = overlap.max(axis=1, initial=0.0) == 0
    rows = []
    for row in np.flatnonzero(overlap.max(axis=0, initial=0.0) == 0).tolist():
        across, down = (centres(right[row][None]) - centres(expected)).T
        sides = np.log(
            np.maximum(right[row, 2:] - right[row, :2], 1) / np.maximum(expected[:, 2:] - expected[:, :2], 1)
        )
        fits = free & (np.abs(across) < ACROSS_PX) & (np.abs(down) > OFF_PX) & (np.abs(sides) < ALIKE).all(axis=1)
        near = np.abs(down) < 4 * (expected[:, 3] - expected[:, 1])
        if (fits & near).any():
            rows.append(row)
    return rows


def _sunward(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Shadows that touch a rock on the side of the Sun lamp, and no rock on the other side."""
    rig = stated_rig()
    for key, (classes, boxes) in sorted(files.items()):
        if key.azimuth not in SUNS or key.position not in survey.SURVEYED_LEFT:
            continue
        rocks, shadows = boxes[classes == ROCK_CLASS], boxes[classes == SHADOW_CLASS]
        feet = _feet(rocks, key, rig, ROCK_FOOT), _feet(shadows, key, rig, SHADOW_FOOT)
        wrong = _on_sunny_side(*feet, survey.lamp_position(key.azimuth)[:2])
        if wrong.any():
            numbers = np.flatnonzero(classes == SHADOW_CLASS)[wrong]
            detail = f"{len(numbers)} of {len(shadows)} shadows, first box {numbers[0] + 1}"
            yield key, Defect("sunward_shadow", detail, tuple(numbers.tolist()))


def _feet(boxes: np.ndarray, key: PhotoKey, rig: StereoRig, foot: float) -> np.ndarray:
    """(n, 3, 2) points on level ground, metres, of boxes' centres at a share of their height and of lower corners."""
    left = surveyed_pose(key.position)
    assert left is not None  # positions of other terrains are left out before
    pose = left if key.camera == "L" else left @ rig.left_from_right
    columns = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 0], boxes[:, 2]], axis=1)
    rows = np.stack([boxes[:, 1] + foot * (boxes[:, 3] - boxes[:, 1]), boxes[:, 3], boxes[:, 3]], axis=1)
    rays = pose.rotate(rig.lens(key.camera).directions(np.stack([columns, rows], axis=-1).reshape(-1, 2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(rays[:, 2] < 0, -pose.translation[2] / rays[:, 2], np.nan)
    return np.asarray((pose.translation + away[:, None] * rays)[:, :2].reshape(-1, 3, 2))


def _on_sunny_side(rocks: np.ndarray, shadows: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """(n,) bool of shadows (n, 3, 2) that lie towards the lamp at a rock (m, 3, 2) which has no other shadow.

    A shadow that a rock within reach may cast is that rock's; a rock with a shadow of its own may have any beside it.
    """
    if not len(rocks) or not len(shadows):
        return np.zeros(len(shadows), bool)
    light = rocks[:, 0] - lamp
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    offset = shadows[:, None, 0] - rocks[None, :, 0]
    distance = np.linalg.norm(offset, axis=-1)
    cosine = (offset * light).sum(axis=-1) / np.maximum(distance, 1e-6)
    half, shadow_half = (np.linalg.norm(feet[:, 2] - feet[:, 1], axis=1) / 2 for feet in (rocks, shadows))
    near = distance < REACH + half[None] + shadow_half[:, None]
    may_be = near & (cosine > AWAY)
    against = near & (cosine < TOWARDS) & ~may_be.any(axis=0)
    return np.asarray(against.any(axis=1) & ~may_be.any(axis=1))

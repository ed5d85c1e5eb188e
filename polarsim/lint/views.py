"""Defects relative to geometry and light: boxes of another view, epipolar violations, shadows on the Sun's side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

import numpy as np

from polarsim.formats.calibrations import stated_rig
from polarsim.geometry.boxes import box_centres, iou, match_by_summed_iou
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.lint.files import ROCK_CLASS, SHADOW_CLASS, Boxes
from polarsim.lint.rules import Defect
from polarsim.lint.siblings import Defects, modals, of_class
from polarsim.photo import NO_SUN, Bracket, CameraSide, PhotoKey, Terrain, photo_scale
from polarsim.run_files.survey import surveyed_pose
from polarsim.site import Site

MIN_BOXES_OF_A_VIEW = 3  # minimum number of boxes that identify a view
MIN_VIEW_LEAD, MIN_VIEW_IOU = 0.25, 0.4  # minimum lead of another view in mean IoU, and minimum mean IoU
# Lengths in pixels are those of photos of the reference width.
OFFSETS_PX = np.arange(-320, 1, 4)  # tried offsets from left to right at the photo's centre
# Start of the fit: change of the offset per row, and vertical offset, of the release's rig. The fit finds those of
# other rigs, if more than half of the boxes start within `NEAR_PX`.
SLOPE, DROP_PX = -0.18, 15.5
PLANE_FITS = 3  # of fitting the offset as a plane
NEAR_PX = 40.0  # maximum distance of a pair from the plane
MIN_PAIRS = 6  # minimum number of pairs for a plane
ACROSS_PX, OFF_PX = 25.0, 15.0  # maximum horizontal and minimum vertical offset of a violation
MAX_LOG_SIDES = 0.4  # maximum log ratio of the sides of a rock's boxes in left and right
ROCK_FOOT, SHADOW_FOOT = 0.75, 0.5  # share of a box's height, from its top, at which its centre is on the ground
MAX_SHADOW_GAP = 0.12  # maximum distance on the ground between the boxes of a rock and its shadow, metres
AWAY, TOWARDS = 0.0, -0.7  # minimum cosine to the direction of light of a possible shadow, maximum of an impossible one


def view_defects(files: Mapping[PhotoKey, Boxes], site: Site) -> Defects:
    """Yield defects of a terrain that need several views, or the positions of cameras and lamps."""
    yield from _other_views(files)
    yield from _other_azimuths(files)
    yield from _off_epipolar(files, site.images.size)
    yield from _sunward_shadows(files, site)


def _other_views(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Yield files with rocks of another view, by the median fit over exposure brackets except that of the file."""
    rocks = of_class(files, ROCK_CLASS)
    sets = modals(rocks)
    fits: dict[tuple[object, ...], dict[tuple[Terrain, str, str], float]] = {}
    for key, boxes in sorted(rocks.items()):
        content = (key.bracket, boxes.tobytes())
        if content not in fits:  # most exposures have the same content
            by_view: dict[tuple[Terrain, str, str], list[float]] = {}
            for name, annotated in sets.items():
                if name != key.bracket:
                    by_view.setdefault(_view(name), []).append(_fit(boxes, annotated))
            fits[content] = {view: float(np.median(of_view)) for view, of_view in by_view.items()}
        best, detail = _better_fit(boxes, fits[content], key.view)
        if best is not None:
            yield key, Defect("other_view", f"rocks of {best[1]} {best[2]}: {detail}")


def _other_azimuths(files: Mapping[PhotoKey, Boxes]) -> Defects:
    """Yield files with shadows of another azimuth, by the fit with brackets of the other light."""
    shadows = of_class(files, SHADOW_CLASS)
    sets = modals(shadows)
    for key, boxes in sorted(shadows.items()):
        if key.has_sun:
            fits = {
                name[3]: _fit(boxes, annotated)
                for name, annotated in sets.items()
                if _view(name) == key.view and name[3] != NO_SUN and name[2] != key.light
            }
            best, detail = _better_fit(boxes, fits, key.azimuth)
            if best is not None:
                yield key, Defect("other_azimuth", f"shadows of azimuth {best}: {detail}")


def _better_fit(boxes: np.ndarray, fits: Mapping[Any, float], own: Any) -> tuple[Any, str]:
    """Return the view or azimuth at which boxes (n, 4) fit clearly better than at their own, or None, and both fits."""
    best = max(fits, key=lambda place: fits[place], default=None)
    if best is None or own not in fits or len(boxes) < MIN_BOXES_OF_A_VIEW:
        return None, ""
    better = fits[best] >= max(MIN_VIEW_IOU, fits[own] + MIN_VIEW_LEAD)
    return best if better else None, f"mean IoU {fits[best]:.2f}, own {fits[own]:.2f}"


def _view(bracket: Bracket) -> tuple[Terrain, str, str]:
    terrain, position, _, _, camera = bracket
    return terrain, position, camera


def _fit(boxes: np.ndarray, known: np.ndarray) -> float:
    """Return the mean IoU of boxes (n, 4) with known boxes."""
    overlap = iou(boxes, known)
    return float(overlap[match_by_summed_iou(overlap)].sum() / max(1, len(boxes)))


def _off_epipolar(files: Mapping[PhotoKey, Boxes], size: tuple[int, int]) -> Defects:
    """Yield right files with rocks above or below their position predicted from the left file."""
    rocks, scale = of_class(files, ROCK_CLASS), photo_scale(size[0])
    sets = modals(rocks)
    for station in sorted({key.station for key in rocks}):
        consensus = {
            camera: consensus_boxes([boxes for name, boxes in sets.items() if _view(name) == (*station, camera)])
            for camera in get_args(CameraSide)
        }
        plane = _right_from_left(consensus["L"], consensus["R"], size)
        if plane is None:
            continue
        for key in sorted(key for key in rocks if (key.station, key.camera) == (station, "R")):
            if key.other_camera in rocks:
                rows = _off_line(_moved(rocks[key.other_camera], plane), rocks[key], scale)
                if rows:
                    yield key, Defect("off_epipolar", f"{len(rows)} rocks, first box {rows[0] + 1} of the rocks")


def _right_from_left(left: np.ndarray, right: np.ndarray, size: tuple[int, int]) -> np.ndarray | None:
    """Fit the offset (3, 2) of a box's centre as a plane over the left photo; None with too few pairs."""
    if min(len(left), len(right)) < MIN_PAIRS:
        return None
    scale, middle = photo_scale(size[0]), size[1] / 2
    starts = [
        np.array([[scale * offset - SLOPE * middle, scale * DROP_PX], [0, 0], [SLOPE, 0]]) for offset in OFFSETS_PX
    ]
    plane = max(starts, key=lambda start: _fit(_moved(left, start), right))
    for _ in range(PLANE_FITS):
        moved = _moved(left, plane)
        overlap = iou(moved, right)
        rows, columns = match_by_summed_iou(overlap)
        near = np.linalg.norm(box_centres(moved[rows]) - box_centres(right[columns]), axis=1) < scale * NEAR_PX
        rows, columns = rows[near], columns[near]
        if len(rows) < MIN_PAIRS:
            return None
        plane = np.linalg.lstsq(_terms(left[rows]), box_centres(right[columns]) - box_centres(left[rows]), rcond=None)[
            0
        ]
    return plane


def _terms(boxes: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(boxes)), box_centres(boxes)])


def _moved(boxes: np.ndarray, plane: np.ndarray) -> np.ndarray:
    return np.asarray(boxes + np.tile(_terms(boxes) @ plane, 2))


def _off_line(expected: np.ndarray, right: np.ndarray, scale: float) -> list[int]:
    """Return rows of unmatched right boxes with the size and column of an unmatched expected box."""
    overlap = iou(expected, right)
    free = overlap.max(axis=1, initial=0.0) == 0
    rows = []
    for row in np.flatnonzero(overlap.max(axis=0, initial=0.0) == 0).tolist():
        across, down = (box_centres(right[row][None]) - box_centres(expected)).T
        sides = np.log(
            np.maximum(right[row, 2:] - right[row, :2], 1) / np.maximum(expected[:, 2:] - expected[:, :2], 1)
        )
        fits = (
            free
            & (np.abs(across) < scale * ACROSS_PX)
            & (np.abs(down) > scale * OFF_PX)
            & (np.abs(sides) < MAX_LOG_SIDES).all(axis=1)
        )
        near = np.abs(down) < 4 * (expected[:, 3] - expected[:, 1])
        if (fits & near).any():
            rows.append(row)
    return rows


def _sunward_shadows(files: Mapping[PhotoKey, Boxes], site: Site) -> Defects:
    """Yield shadows next to a rock on the side of the Sun lamp without a rock on the opposite side.

    Positions without an approximate pose are skipped, and all of a site without a calibration.
    """
    if site.cameras.calibration is None:
        return
    rig = stated_rig(site)
    for key, (classes, boxes) in sorted(files.items()):
        tripod = site.tripods_of(key.terrain).get(key.position)
        if not key.has_sun or tripod is None:
            continue
        rocks, shadows = boxes[classes == ROCK_CLASS], boxes[classes == SHADOW_CLASS]
        pose = surveyed_pose(tripod) if key.camera == "L" else surveyed_pose(tripod) @ rig.left_from_right
        lens = rig.lens(key.camera)
        feet = _feet(rocks, pose, lens, ROCK_FOOT), _feet(shadows, pose, lens, SHADOW_FOOT)
        wrong = _on_sunny_side(*feet, np.array(site.lamps[key.azimuth].point)[:2])
        if wrong.any():
            numbers = np.flatnonzero(classes == SHADOW_CLASS)[wrong]
            detail = f"{len(numbers)} of {len(shadows)} shadows, first box {numbers[0] + 1}"
            yield key, Defect("sunward_shadow", detail, tuple(numbers.tolist()))


def _feet(boxes: np.ndarray, pose: Pose, lens: Lens, foot: float) -> np.ndarray:
    """Return ground points (n, 3, 2), metres, of boxes' centres at a share of their height and of lower corners."""
    columns = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 0], boxes[:, 2]], axis=1)
    rows = np.stack([boxes[:, 1] + foot * (boxes[:, 3] - boxes[:, 1]), boxes[:, 3], boxes[:, 3]], axis=1)
    rays = pose.rotate(lens.directions(np.stack([columns, rows], axis=-1).reshape(-1, 2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(rays[:, 2] < 0, -pose.translation[2] / rays[:, 2], np.nan)
    return np.asarray((pose.translation + away[:, None] * rays)[:, :2].reshape(-1, 3, 2))


def _on_sunny_side(rocks: np.ndarray, shadows: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """Return a mask (n,) of shadows (n, 3, 2) towards the lamp at a rock (m, 3, 2) without another shadow.

    Shadows that a nearby rock may cast are excluded, and rocks with such a shadow.
    """
    if not len(rocks) or not len(shadows):
        return np.zeros(len(shadows), bool)
    light = rocks[:, 0] - lamp
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    offset = shadows[:, None, 0] - rocks[None, :, 0]
    distance = np.linalg.norm(offset, axis=-1)
    cosine = (offset * light).sum(axis=-1) / np.maximum(distance, 1e-6)
    half, shadow_half = (np.linalg.norm(feet[:, 2] - feet[:, 1], axis=1) / 2 for feet in (rocks, shadows))
    near = distance < MAX_SHADOW_GAP + half[None] + shadow_half[:, None]
    may_be = near & (cosine > AWAY)
    against = near & (cosine < TOWARDS) & ~may_be.any(axis=0)
    return np.asarray(against.any(axis=1) & ~may_be.any(axis=1))

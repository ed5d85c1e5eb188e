"""Exact labels of the twins, from the id map of a view: rock and shadow boxes, instance masks, label rows.

Labels include amodal masks: the pixels that a rock would cover if no other rock or wall occluded it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from polarsim.formats import png, rle, tables, yolo
from polarsim.formats.coco_annotations import Amodal, Annotation
from polarsim.geometry.boxes import box_around_points, box_of_mask, pixel_window
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.polygons import without_thin_parts
from polarsim.geometry.rays import NO_FACE, START_OFFSET
from polarsim.geometry.vectors import length, points_along
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey, by_bracket
from polarsim.render.lamps import lamps_on
from polarsim.render.olat import NO_LAMP
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND, ROCK_IDS, SHADOW_IDS, instance_map_name

SOURCE_RENDERED = "rendered"  # source of labels computed by rays
_TOUCHING = np.ones((3, 3), bool)  # 8-connectivity
_MARGIN_PX = 2  # maximum distance by which distortion moves the edges of a box out of the box around the corners


def boxes_of_ids(ids: np.ndarray, options: RenderOptions) -> list[tuple[str, int, np.ndarray]]:
    """Return (kind, rock, box) of every sufficiently large rock and shadow in an id map (h, w), rocks first.

    Parts of a shadow thinner than `min_shadow_width_px` are excluded from area and box.
    """
    boxes = []
    for number, extent in enumerate(ndimage.find_objects(ids.astype(np.int32)), 1):
        if extent is None or number < ROCK_IDS:
            continue
        kind, rock = (ROCK, number - ROCK_IDS) if number < SHADOW_IDS else (SHADOW, number - SHADOW_IDS)
        min_area = options.min_rock_area_px if kind == ROCK else options.min_shadow_area_px
        mask = ids[extent] == number
        if kind == SHADOW:  # a dark line along the base of a rock is not annotated as a shadow
            mask = without_thin_parts(mask, options.min_shadow_width_px)
        box = box_of_parts(mask, min_area, options.min_part_area_px)
        if box is not None:
            corner = [extent[1].start, extent[0].start]
            boxes.append((kind, rock, box + np.tile(corner, 2)))
    return boxes


def box_of_parts(mask: np.ndarray, min_px: int, min_part_px: int) -> np.ndarray | None:
    """Return the box (4,) of the connected parts of at least `min_part_px`; None if they total less than `min_px`."""
    parts, _ = ndimage.label(mask, _TOUCHING)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    large = sizes >= min_part_px
    return box_of_mask(large[parts]) if sizes[large].sum() >= min_px else None


def annotate_ids(
    ids: np.ndarray, options: RenderOptions, occluded: Mapping[int, Amodal] | None = None
) -> list[Annotation]:
    """Return the labels of `boxes_of_ids` with masks: the visible pixels of the object inside the box.

    `occluded`: amodal masks of partly occluded rocks (`amodal_masks`); if given, all other rocks are fully visible.
    """
    annotations = []
    for kind, rock, box in boxes_of_ids(ids, options):
        left, top, right, bottom = box.astype(int).tolist()
        number = rock + (ROCK_IDS if kind == ROCK else SHADOW_IDS)
        mask = rle.encode_rle(ids[top:bottom, left:right] == number, ids.shape[::-1], left, top)
        amodal = None
        if occluded is not None and kind == ROCK:
            amodal = occluded.get(rock, Amodal(mask, box))
        annotations.append(Annotation(kind, rock, box, mask, SOURCE_RENDERED, amodal=amodal))
    return annotations


def amodal_masks(ids: np.ndarray, hidden: Mapping[int, np.ndarray], options: RenderOptions) -> dict[int, Amodal]:
    """Return the amodal masks of the partly occluded rocks of an id map (h, w), by rock.

    `hidden`: flat numbers (n,) of the occluded pixels of each rock (`occluded_pixels`).
    """
    amodal = {}
    for rock, occluded in hidden.items():
        if not len(occluded):
            continue
        rows, columns = np.divmod(np.append(np.flatnonzero(ids == ROCK_IDS + rock), occluded), ids.shape[1])
        top, left = int(rows.min()), int(columns.min())
        mask = np.zeros((int(rows.max()) - top + 1, int(columns.max()) - left + 1), bool)
        mask[rows - top, columns - left] = True
        box = box_of_parts(mask, options.min_rock_area_px, options.min_part_area_px)
        if box is not None:
            x0, y0, x1, y1 = box.astype(int).tolist()
            runs = rle.encode_rle(mask[y0:y1, x0:x1], ids.shape[::-1], left + x0, top + y0)
            amodal[rock] = Amodal(runs, box + np.tile([left, top], 2))
    return amodal


def annotate_view(surfaces: Surfaces, camera: Camera, ids: np.ndarray, options: RenderOptions) -> list[Annotation]:
    """Return the labels of an id map (h, w) of a view, with amodal masks."""
    return annotate_ids(ids, options, amodal_masks(ids, occluded_pixels(surfaces, camera, ids), options))


def label_view(
    keys: Sequence[PhotoKey],
    ids: Mapping[str, np.ndarray],
    surfaces: Surfaces,
    camera: Camera,
    boxes: Path,
    instances: Path,
    options: RenderOptions,
) -> dict[PhotoKey, list[Annotation]]:
    """Write and return the labels of the twins of a view, equal for all models and exposures of a bracket.

    `ids`: `Rendering.ids` of the view. `boxes`: folder for `KEY.txt`; the file is empty if no lamp is on, because the
    image is black. `instances`: folder for `TT_P_light_az_C.png`, the id map of an exposure bracket.
    """
    rocks = annotate_view(surfaces, camera, ids[NO_LAMP], options)
    by_lamp = {NO_LAMP: rocks}
    for name, id_map in ids.items():
        shadows = id_map * (id_map >= SHADOW_IDS)  # the rocks of a view are equal under every lamp
        by_lamp[name] = rocks + annotate_ids(shadows, options)
    labels: dict[PhotoKey, list[Annotation]] = {}
    for bracket in by_bracket(keys).values():
        lamps = lamps_on(bracket[0])
        of_bracket = by_lamp[lamps[0]] if lamps else []
        png.write_png(instances / instance_map_name(bracket[0]), ids[lamps[0] if lamps else NO_LAMP])
        classes = np.array([BOX_CLASSES.index(label.kind) for label in of_bracket], int)
        rectangles = np.array([label.box for label in of_bracket], float)
        for key in bracket:
            labels[key] = of_bracket
            yolo.write_boxes(boxes / f"{key}.txt", classes, rectangles, (camera.lens.width, camera.lens.height))
    return labels


def label_row(key: PhotoKey, label: Annotation) -> dict[str, object]:
    """Return a row of the label table."""
    corners = dict(zip(("x0", "y0", "x1", "y1"), label.box.tolist(), strict=True))
    named = {"kind": label.kind, "rock": label.rock, "source": label.source, "confidence": label.confidence}
    return {**tables.key_columns(key), **named, **corners}


def occluded_pixels(surfaces: Surfaces, camera: Camera, ids: np.ndarray) -> dict[int, np.ndarray]:
    """Return the pixels at which other rocks or walls occlude a visible rock: sorted flat numbers (n,) by rock.

    Parts occluded by the ground (buried, or behind a mound) are not included. Rays are cast only near a rock, through
    pixels that show another rock, a wall or background.

    `ids` (h, w): id map of the view, with or without shadows.
    """
    shown = np.flatnonzero(np.bincount(ids.ravel(), minlength=SHADOW_IDS)[ROCK_IDS:SHADOW_IDS]).tolist()
    windows = {rock: _window(surfaces.rock_corners[rock], camera) for rock in shown}
    in_front = (ids == BACKGROUND) | ((ids >= ROCK_IDS) & (ids < SHADOW_IDS))
    candidates = np.zeros(ids.shape, bool)
    for rock, near in windows.items():
        candidates[near] |= in_front[near] & (ids[near] != ROCK_IDS + rock)
    pixels = np.flatnonzero(candidates)
    row, column = np.divmod(pixels, camera.lens.width)
    directions = camera.directions(np.stack([column, row], axis=1) + HALF_PIXEL)
    hidden: dict[int, list[np.ndarray]] = {rock: [] for rock in windows}
    for rays, rock_of_ray in _rocks_along(surfaces, camera.centre, directions):
        for rock in np.intersect1d(rock_of_ray, list(windows)):
            crossed = pixels[rays[rock_of_ray == rock]]
            hidden[rock].append(crossed[ids.reshape(-1)[crossed] != ROCK_IDS + rock])
    return {
        rock: np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64) for rock, parts in hidden.items()
    }


def _window(corners: np.ndarray, camera: Camera) -> tuple[slice, slice]:
    """Return the rows and columns of the pixels that may show the box with corners (n, 3)."""
    # The distortion model may project points far outside the photo back into it; the undistorted projection does not.
    straight = replace(camera, lens=replace(camera.lens, distortion=(0.0,) * 5))
    pixels = np.concatenate([camera.project(corners), straight.project(corners)])
    if np.isnan(pixels).any():  # a corner behind the camera
        return slice(0, camera.lens.height), slice(0, camera.lens.width)
    return pixel_window(box_around_points(pixels), np.full(2, _MARGIN_PX), *camera.size)


def _rocks_along(
    surfaces: Surfaces, origin: np.ndarray, directions: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield numbers of rays and the rock that each ray hits, for every rock surface in front of the ground."""
    ground = _distance_to_ground(surfaces, origin, directions)
    step = START_OFFSET / length(directions)
    travelled, on = np.zeros(len(directions)), np.arange(len(directions))
    while len(on):
        along = directions[on]
        distance, face = surfaces.rocks.nearest(points_along(origin, along, travelled[on]), along)
        travelled[on] += distance
        before = travelled[on] < ground[on]
        on, face = on[before], face[before]
        yield on, surfaces.id_of_face[surfaces.rock_faces[face]] - ROCK_IDS
        travelled[on] += step[on]


def _distance_to_ground(surfaces: Surfaces, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the ray parameter (n,) of the ground, passing through walls; inf for rays that miss the ground."""
    step = START_OFFSET / length(directions)
    travelled, on = np.zeros(len(directions)), np.arange(len(directions))
    while len(on):
        along = directions[on]
        distance, face = surfaces.rest.nearest(points_along(origin, along, travelled[on]), along)
        travelled[on] += distance
        on = on[(face != NO_FACE) & (surfaces.id_of_face[surfaces.rest_faces[face]] == BACKGROUND)]
        travelled[on] += step[on]
    return travelled

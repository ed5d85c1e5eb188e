"""Exact labels of the twins, from what every pixel's ray met: rock and shadow boxes, instance masks, label rows.

Whole rocks are among them: the pixels that a rock would cover if neither other rocks nor walls stood in front of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from polarsim.formats import coco, png, rle, tables, yolo
from polarsim.geometry.boxes import around, of_mask, window
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.polygons import without_thin_parts
from polarsim.geometry.rays import NO_FACE, START_OFFSET
from polarsim.geometry.vectors import length, moved
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey, by_bracket
from polarsim.render.lamps import lit_by
from polarsim.render.olat import NO_LAMP
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND, ROCK_IDS, SHADOW_IDS

SOURCE = "rendered"  # of labels that are what rays met
_TOUCHING = np.ones((3, 3), bool)  # pixels that meet at a corner belong together
_MARGIN_PX = 2  # by which a lens bends the edges of a box out of the box around its corners


def boxes_of(ids: np.ndarray, options: RenderOptions) -> list[tuple[str, int, np.ndarray]]:
    """(kind, rock, box) of every rock and shadow that is large enough in a picture of ids (h, w), rocks first.

    Parts of a shadow thinner than `min_shadow_width_px` neither count nor widen its box.
    """
    found = []
    for number, extent in enumerate(ndimage.find_objects(ids.astype(np.int32)), 1):
        if extent is None or number < ROCK_IDS:
            continue
        kind, rock = (ROCK, number - ROCK_IDS) if number < SHADOW_IDS else (SHADOW, number - SHADOW_IDS)
        least = options.min_rock_area_px if kind == ROCK else options.min_shadow_area_px
        mask = ids[extent] == number
        if kind == SHADOW:  # nobody takes a line of dark pixels along a rock's foot for its shadow
            mask = without_thin_parts(mask, options.min_shadow_width_px)
        box = box_of_parts(mask, least, options.min_part_area_px)
        if box is not None:
            corner = [extent[1].start, extent[0].start]
            found.append((kind, rock, box + np.tile(corner, 2)))
    return found


def box_of_parts(mask: np.ndarray, least_px: int, least_part_px: int) -> np.ndarray | None:
    """(4,) box around the connected parts of at least `least_part_px`; None where they have fewer than `least_px`."""
    parts, _ = ndimage.label(mask, _TOUCHING)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    large = sizes >= least_part_px
    return of_mask(large[parts]) if sizes[large].sum() >= least_px else None


def annotations_of(
    ids: np.ndarray, options: RenderOptions, occluded: Mapping[int, coco.Amodal] | None = None
) -> list[coco.Annotation]:
    """The same with their masks: the pixels inside the box that show the thing.

    `occluded`: amodal masks of the rocks that others hide in part (`whole_rocks`); all other rocks are then seen
    whole. Rocks of which too small a share is visible are left out; their shadows stay.
    """
    found = []
    for kind, rock, box in boxes_of(ids, options):
        left, top, right, bottom = box.astype(int).tolist()
        number = rock + (ROCK_IDS if kind == ROCK else SHADOW_IDS)
        mask = rle.encode(ids[top:bottom, left:right] == number, left, top, ids.shape[::-1])
        amodal = None
        if occluded is not None and kind == ROCK:
            amodal = occluded.get(rock, coco.Amodal(mask, box))
        label = coco.Annotation(kind, rock, box, mask, SOURCE, amodal=amodal)
        if label.visible_share >= options.min_visible_share:
            found.append(label)
    return found


def whole_rocks(ids: np.ndarray, hidden: Mapping[int, np.ndarray], options: RenderOptions) -> dict[int, coco.Amodal]:
    """Amodal masks of the rocks of a picture of ids (h, w) that others hide in part, by rock.

    `hidden`: flat pixels (n,) of each where something else stands in front (`hidden_parts`).
    """
    found = {}
    for rock, behind in hidden.items():
        if not len(behind):
            continue
        rows, columns = np.divmod(np.append(np.flatnonzero(ids == ROCK_IDS + rock), behind), ids.shape[1])
        top, left = int(rows.min()), int(columns.min())
        mask = np.zeros((int(rows.max()) - top + 1, int(columns.max()) - left + 1), bool)
        mask[rows - top, columns - left] = True
        box = box_of_parts(mask, options.min_rock_area_px, options.min_part_area_px)
        if box is not None:
            x0, y0, x1, y1 = box.astype(int).tolist()
            runs = rle.encode(mask[y0:y1, x0:x1], left + x0, top + y0, ids.shape[::-1])
            found[rock] = coco.Amodal(runs, box + np.tile([left, top], 2))
    return found


def label_view(
    keys: Sequence[PhotoKey],
    ids: Mapping[str, np.ndarray],
    hidden: Mapping[int, np.ndarray],
    boxes: Path,
    instances: Path,
    options: RenderOptions,
) -> dict[PhotoKey, list[coco.Annotation]]:
    """Write the labels of one view's twins, the same for all models and all exposures of an exposure bracket, and
    return them.

    Parameters
    ----------
    ids : lamp -> (h, w) uint16
        The view's `Rendering.ids`.
    hidden : rock -> (n,) int
        What `hidden_parts` found in it.
    boxes : Path
        Folder for `KEY.txt`; empty where no lamp is on, for nothing is to be seen there.
    instances : Path
        Folder for `TT_P_light_az_C.png`, the ids of an exposure bracket.
    """
    occluded = whole_rocks(ids[NO_LAMP], hidden, options)
    rocks = annotations_of(ids[NO_LAMP], options, occluded)
    found = {NO_LAMP: rocks}
    for name, picture in ids.items():
        shadows = picture * (picture >= SHADOW_IDS)  # a view's rocks are the same under every lamp
        found[name] = rocks + annotations_of(shadows, options)
    labels: dict[PhotoKey, list[coco.Annotation]] = {}
    for bracket in by_bracket(keys).values():
        lamps = lit_by(bracket[0])
        own = found[lamps[0]] if lamps else []
        png.write(instances / f"{str(bracket[0]).rpartition('_')[0]}.png", ids[lamps[0] if lamps else NO_LAMP])
        classes, own_boxes = [BOX_CLASSES.index(label.kind) for label in own], [label.box for label in own]
        for key in bracket:
            labels[key] = own
            yolo.write_boxes(boxes / f"{key}.txt", np.array(classes, int), np.array(own_boxes, float))
    return labels


def label_row(key: PhotoKey, label: coco.Annotation) -> dict[str, object]:
    """A row of the label table."""
    corners = dict(zip(("x0", "y0", "x1", "y1"), label.box.tolist(), strict=True))
    named = {"kind": label.kind, "rock": label.rock, "source": label.source, "confidence": label.confidence}
    return {**tables.key_columns(key), **named, **corners}


def hidden_parts(surfaces: Surfaces, camera: Camera, ids: np.ndarray) -> dict[int, np.ndarray]:
    """Pixels of each rock in the picture that other rocks and walls hide: (n,) flat numbers, sorted, by rock.

    What the ground hides of a rock, buried or behind a mound, is none of them. Rays are cast only where the picture
    shows another rock, a wall or nothing, near the rock.

    Parameters
    ----------
    ids : (h, w) uint16
        Of the view, without shadows or with them.
    """
    windows = {rock: _window(surfaces.rock_corners[rock], camera) for rock in _rocks_in(ids)}
    in_front = (ids == BACKGROUND) | ((ids >= ROCK_IDS) & (ids < SHADOW_IDS))
    asked = np.zeros(ids.shape, bool)
    for rock, near in windows.items():
        asked[near] |= in_front[near] & (ids[near] != ROCK_IDS + rock)
    pixels = np.flatnonzero(asked)
    row, column = np.divmod(pixels, camera.lens.width)
    directions = camera.directions(np.stack([column, row], axis=1) + HALF_PIXEL)
    hidden: dict[int, list[np.ndarray]] = {rock: [] for rock in windows}
    for rays, rock_of_ray in _rocks_along(surfaces, camera.centre, directions):
        for rock in np.intersect1d(rock_of_ray, list(windows)):
            behind = pixels[rays[rock_of_ray == rock]]
            hidden[rock].append(behind[ids.reshape(-1)[behind] != ROCK_IDS + rock])
    return {
        rock: np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64) for rock, parts in hidden.items()
    }


def _rocks_in(ids: np.ndarray) -> list[int]:
    shown = np.flatnonzero(np.bincount(ids.ravel(), minlength=SHADOW_IDS)[ROCK_IDS:SHADOW_IDS])
    return [int(rock) for rock in shown]


def _window(corners: np.ndarray, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns of the pixels that may show what lies between corners (n, 3)."""
    # Far outside the photo a lens may bend points back into it; without distortion they stay outside.
    straight = replace(camera, lens=replace(camera.lens, distortion=(0.0,) * 5))
    pixels = np.concatenate([camera.project(corners), straight.project(corners)])
    if np.isnan(pixels).any():  # a corner behind the camera
        return slice(0, camera.lens.height), slice(0, camera.lens.width)
    return window(around(pixels), np.full(2, _MARGIN_PX), *camera.size)


def _rocks_along(
    surfaces: Surfaces, origin: np.ndarray, directions: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Numbers of rays and the rock that each meets: once for every surface of a rock before the ground."""
    ground = _distance_to_ground(surfaces, origin, directions)
    step = START_OFFSET / length(directions)
    travelled, on = np.zeros(len(directions)), np.arange(len(directions))
    while len(on):
        along = directions[on]
        distance, face = surfaces.rocks.nearest(moved(origin, along, travelled[on]), along)
        travelled[on] += distance
        before = travelled[on] < ground[on]
        on, face = on[before], face[before]
        yield on, surfaces.id_of_face[surfaces.rock_faces[face]] - ROCK_IDS
        travelled[on] += step[on]


def _distance_to_ground(surfaces: Surfaces, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n,) in units of the directions' length, through walls; inf where a ray meets no ground."""
    step = START_OFFSET / length(directions)
    travelled, on = np.zeros(len(directions)), np.arange(len(directions))
    while len(on):
        along = directions[on]
        distance, face = surfaces.rest.nearest(moved(origin, along, travelled[on]), along)
        travelled[on] += distance
        on = on[(face != NO_FACE) & (surfaces.id_of_face[surfaces.rest_faces[face]] == BACKGROUND)]
        travelled[on] += step[on]
    return travelled

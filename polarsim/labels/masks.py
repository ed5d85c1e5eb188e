"""Outlines of every labelled rock and shadow, of ground and background: YOLO polygons and grey maps.

A box says where a person saw a thing, the meshes say which shape it has: the visible shape of the rock's mesh, or of
the shadow that it casts, is stretched from its own box to the label's. A view and lamp is drawn once for all exposures.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import lamps, png, rigs, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.formats.scene import read_terrain
from polarsim.geometry.boxes import iou, of_mask
from polarsim.geometry.polygons import outlines, paint
from polarsim.geometry.rays import Caster, caster
from polarsim.labels.identity import dome_behind
from polarsim.labels.options import LabelsOptions
from polarsim.labels.shadows import Ids, lamp
from polarsim.labels.view import View
from polarsim.labels.world import Dome, World, build_world, with_domes
from polarsim.photo import HEIGHT, NO_ROCK, POLYGON_CLASSES, ROCK, SHADOW, WIDTH, Azimuth, Light, PhotoKey

log = logging.getLogger(__name__)

Polygons = list[tuple[int, np.ndarray]]  # class number and ring (n, 2) in pixels
PHOTO_FRAME = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT]], float)
LIKE_ITS_BOX = 0.2  # smallest IoU of a shape's own box with its label's for the shape to be believed
SMALL_REGION = 400  # px: smaller pieces of ground or background are not worth a polygon


@dataclass(frozen=True)
class Shape:
    """A mask (h, w) of full pixels whose first pixel is (left, top)."""

    mask: np.ndarray
    left: int
    top: int

    @property
    def box(self) -> np.ndarray:
        """(4,) around its true pixels."""
        found = of_mask(self.mask)
        assert found is not None
        return found + np.tile([self.left, self.top], 2)

    def polygons(self, number: int, simplify_px: float) -> Polygons:
        shift = np.array([self.left, self.top], float)
        return [(number, ring + shift) for ring in outlines(self.mask, simplify_px)]


def shape_of(ids: np.ndarray, rock: int) -> Shape | None:
    """Where a picture of ids (h, w) shows a rock; None where it does not."""
    mask = ids == rock
    box = of_mask(mask)
    if box is None:
        return None
    left, top, right, bottom = box.astype(int)
    return Shape(mask[top:bottom, left:right], left, top)


def stretched(shape: Shape, box: np.ndarray) -> Shape:
    """The shape with its own box mapped to another (4,)."""
    own, x, y = shape.box, *_pixel_centres(box)
    column = own[0] + (x - box[0]) / (box[2] - box[0]) * (own[2] - own[0]) - shape.left
    row = own[1] + (y - box[1]) / (box[3] - box[1]) * (own[3] - own[1]) - shape.top
    column = np.clip(np.floor(column).astype(int), 0, shape.mask.shape[1] - 1)
    row = np.clip(np.floor(row).astype(int), 0, shape.mask.shape[0] - 1)
    inside = ((y > box[1]) & (y < box[3]))[:, None] & ((x > box[0]) & (x < box[2]))
    return Shape(shape.mask[np.ix_(row, column)] & inside, int(x[0] - 0.5), int(y[0] - 0.5))


def rounded(box: np.ndarray, power: float = 2.5) -> Shape:
    """A superellipse that fills a box (4,): the shape of a thing of which nothing but its box is known."""
    x, y = _pixel_centres(box)
    across = np.abs((2 * x - box[0] - box[2]) / (box[2] - box[0])) ** power
    down = np.abs((2 * y - box[1] - box[3]) / (box[3] - box[1])) ** power
    return Shape(down[:, None] + across <= 1, int(x[0] - 0.5), int(y[0] - 0.5))


def _pixel_centres(box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    left, top = np.floor(box[:2]).astype(int)
    right, bottom = np.maximum(np.ceil(box[2:]).astype(int), [left + 1, top + 1])
    return np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5


class ViewOutlines:
    """Outlines in one view under any lamp. Rays are cast once; labels are rows of the label table."""

    def __init__(self, world: World, view: View, labels: pd.DataFrame, options: LabelsOptions) -> None:
        self.options, self.view = options, view
        self.world = with_domes(world, _domes(world, view, labels))
        width, height = view.size
        self.ids = Ids(self.world, view, np.arange(height) + 0.5, np.arange(width) + 0.5)
        self._seen = _wall_free(self.world, view, self.ids, options.wall_height_m)
        self._area = self._ground_and_background()
        self._rocks: dict[int, Shape | None] = {}
        self._shadows: dict[tuple[float, ...], np.ndarray] = {}
        self._drawn: dict[bytes, Polygons] = {}

    def polygons(self, light: Light, azimuth: Azimuth, labels: pd.DataFrame) -> Polygons:
        """Background, ground, shadows and rocks, in the order in which they are painted."""
        place = lamp(self.world, self.view, light, azimuth)
        if place is None:
            return [(POLYGON_CLASSES.index("background"), PHOTO_FRAME)]
        boxes = labels[["x0", "y0", "x1", "y1"]].to_numpy(float).reshape(-1, 4)
        rocks = labels["rock"].to_numpy(int)
        is_rock = (labels["kind"] == ROCK).to_numpy(bool)
        content = place.tobytes() + boxes.tobytes() + rocks.tobytes() + is_rock.tobytes()
        if content not in self._drawn:
            # Far things first: where outlines overlap, the nearer one, lower in the photo, is painted over the other.
            order = np.argsort(boxes[:, 3], kind="stable")
            shadows = [self._shadow(int(rocks[row]), boxes[row], place) for row in order if not is_rock[row]]
            stones = [self._rock(int(rocks[row]), boxes[row]) for row in order if is_rock[row]]
            simplify = self.options.simplify_px
            self._drawn[content] = [
                *self._area,
                *(polygon for shape in shadows for polygon in shape.polygons(POLYGON_CLASSES.index(SHADOW), simplify)),
                *(polygon for shape in stones for polygon in shape.polygons(POLYGON_CLASSES.index(ROCK), simplify)),
            ]
        return self._drawn[content]

    def _rock(self, rock: int, box: np.ndarray) -> Shape:
        if rock not in self._rocks:
            self._rocks[rock] = shape_of(self.ids.rock, rock) if rock != NO_ROCK else None
        return _fitted(self._rocks[rock], box)

    def _shadow(self, rock: int, box: np.ndarray, place: np.ndarray) -> Shape:
        lamp_place = tuple(place.tolist())
        if lamp_place not in self._shadows:
            self._shadows[lamp_place] = self.ids.shadow_of(self.world, place)
        return _fitted(shape_of(self._shadows[lamp_place], rock) if rock != NO_ROCK else None, box)

    def _ground_and_background(self) -> Polygons:
        import cv2

        ground = np.zeros(self._seen.shape, np.uint8)
        lines, _ = cv2.findContours(self._seen.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(ground, [line for line in lines if cv2.contourArea(line) >= SMALL_REGION], -1, 1, cv2.FILLED)
        simplify = self.options.simplify_px
        polygons: Polygons = []
        for name, mask in (("background", ground == 0), ("ground", ground == 1)):
            number = POLYGON_CLASSES.index(name)
            polygons += [p for p in Shape(mask, 0, 0).polygons(number, simplify) if np.ptp(p[1], axis=0).min() >= 2]
        return polygons


def _fitted(shape: Shape | None, box: np.ndarray) -> Shape:
    """A shape stretched to its label's box; a rounded box where the shape is missing or lies elsewhere."""
    if shape is None or iou(shape.box[None], box[None])[0, 0] < LIKE_ITS_BOX:
        return rounded(box)
    return stretched(shape, box)


def _domes(world: World, view: View, labels: pd.DataFrame) -> dict[int, Dome]:
    """Stand-ins of the labelled rocks of a view that have no mesh, from their mean boxes."""
    stones = labels[(labels["kind"] == ROCK) & ~labels["rock"].isin([NO_ROCK, *world.bodies])]
    boxes = stones.groupby("rock", as_index=False)[["x0", "y0", "x1", "y1"]].mean().to_numpy(float)
    found = {int(row[0]): dome_behind(world, view, row[1:]) for row in boxes}
    return {rock: dome for rock, dome in found.items() if dome is not None}


def _wall_free(world: World, view: View, ids: Ids, wall_height: float) -> np.ndarray:
    """(h, w) bool: pixels that show ground or rocks, and no wall of the sandbox in front of them."""
    seen = ids.hit.copy()
    walls = wall_caster(world, wall_height)
    if walls is None:
        return seen
    directions = ids.places - view.centre
    seen[ids.ground] &= ~walls.blocked(np.broadcast_to(view.centre, directions.shape), directions, 1.0)
    return seen


def wall_caster(world: World, height: float) -> Caster | None:
    """The four walls around the ground mesh, `height` metres above the ground's level; None for no walls."""
    if height <= 0:
        return None
    low, high = world.ground_bounds
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    bottom = np.column_stack([corners, np.full(4, world.ground_level - height)])
    top = np.column_stack([corners, np.full(4, world.ground_level + height)])
    following = np.roll(np.arange(4), -1)
    faces = np.concatenate(
        [
            np.column_stack([np.arange(4), following, following + 4]),
            np.column_stack([np.arange(4), following + 4, np.arange(4) + 4]),
        ]
    )
    return caster(np.concatenate([bottom, top]), faces)


def draw_masks(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    table: Path,
    cameras: Path,
    meshes: Path,
    polygons: Path,
    masks: Path,
    options: LabelsOptions,
) -> None:
    """Write `polygons`/KEY.txt and `masks`/KEY.png for every key: one drawing a photo set, of its fullest labels."""
    labels = tables.read_parquet(table, tables.LABEL_COLUMNS)
    placed = rigs.read_all_placed(cameras)
    world = build_world(read_terrain(meshes, terrain), options.trim_mm / 1000, lamps.read_suns(cameras, placed))
    sets: dict[tuple, list[PhotoKey]] = {}
    for key in sorted(keys):
        sets.setdefault((key.view, key.light, key.azimuth), []).append(key)
    view_outlines: ViewOutlines | None = None
    last_view = None
    with writing_folder(polygons) as polygon_folder, writing_folder(masks) as mask_folder:
        for (view_name, light, azimuth), members in sorted(sets.items(), key=lambda item: item[1][0].view):
            _, position, camera = view_name
            if position not in placed:
                log.warning("terrain %02d, position %s: no camera pose, no outlines", terrain, position)
                continue
            in_view = labels[(labels["position"] == position) & (labels["camera"] == camera)]
            if view_name != last_view:
                view_outlines, last_view = (
                    ViewOutlines(world, View(placed[position], camera), in_view, options),
                    view_name,
                )
            assert view_outlines is not None
            drawn = view_outlines.polygons(light, azimuth, _fullest(in_view, members))
            _write(polygon_folder, mask_folder, members, drawn)


def _fullest(labels: pd.DataFrame, keys: Sequence[PhotoKey]) -> pd.DataFrame:
    """The labels of the photo with most of them among some keys; the longest exposure of several."""
    names = {str(key): key.exposure_ms for key in keys}
    own = labels[labels["key"].isin(names)]
    if own.empty:
        return own
    counts = own["key"].value_counts()
    best = max(counts.index, key=lambda name: (counts[name], names[name]))
    return own[own["key"] == best]


def _write(polygon_folder: Path, mask_folder: Path, keys: Sequence[PhotoKey], drawn: Polygons) -> None:
    first, *others = (str(key) for key in keys)
    yolo.write_polygons(polygon_folder / f"{first}.txt", drawn)
    png.write(mask_folder / f"{first}.png", paint(drawn))
    for name in others:
        shutil.copyfile(polygon_folder / f"{first}.txt", polygon_folder / f"{name}.txt")
        shutil.copyfile(mask_folder / f"{first}.png", mask_folder / f"{name}.png")

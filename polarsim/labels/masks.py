"""Visible shape of every labelled rock and shadow, ground and background: YOLO polygons, grey maps and COCO masks.

The label determines the position, the mesh determines the shape: the visible projection of a rock mesh or of a cast
shadow is stretched towards the box of the label. Human outlines are convex and tighter than human boxes, so the shape
is replaced by the convex hull and stretched only part of the way. Each view and lamp is drawn once for all exposures.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import coco, png, tables, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.files import writing_folder
from polarsim.formats.mask_sheet import tile_of_mask, write_mask_sheet
from polarsim.formats.rle import Rle
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.polygons import paint, paint_on
from polarsim.labels.association import fit_dome
from polarsim.labels.bodies import Dome, TerrainCasters, active_lamp, build_worlds, with_domes
from polarsim.labels.casting import VisibleIds
from polarsim.labels.shapes import MaskShape, backdrop, convex_shape, fit_shape, mask_shapes, visible_parts
from polarsim.photo import NO_ROCK, POLYGON_CLASSES, ROCK, Azimuth, Light, PhotoKey, Terrain, terrain_text
from polarsim.run_files import lamps, rigs
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import read_terrain
from polarsim.site import Site

log = logging.getLogger(__name__)

Polygons = list[tuple[int, np.ndarray]]  # class number and ring (n, 2) in pixels
# Target box of an outline: position between the box of the label (0) and the box of the projected mesh or of the cast
# shadow (1). Fitted to human polygons.
OUTLINE_MESH_SHARE, OUTLINE_CAST_SHARE = 0.5, 0.35
BOX_COLUMNS = ["x0", "y0", "x1", "y1"]

LabelShapeKey = tuple[str, int, bytes]  # kind, rock and box, which determine the shape of a label under one lamp


@dataclass(frozen=True)
class Backdrop:
    """Background and ground of a view."""

    polygons: Polygons
    size: tuple[int, int]  # width and height of the photo

    @cached_property
    def grey(self) -> np.ndarray:
        """Grey map (h, w) uint8."""
        return paint(self.polygons, self.size[::-1])


@dataclass(frozen=True)
class BracketOutlines:
    """Visible parts of the labels of an exposure bracket, in painting order."""

    parts: dict[LabelShapeKey, MaskShape | None]
    backdrop: Backdrop
    size: tuple[int, int]  # width and height of the photo

    @cached_property
    def masks(self) -> dict[LabelShapeKey, Rle]:
        """Run-length encoding of each visible part, for all exposures."""
        return {thing: part.runs(self.size) for thing, part in self.parts.items() if part is not None}

    @cached_property
    def things(self) -> Polygons:
        """Polygons of shadows and rocks."""
        parts = [(kind, part) for (kind, _, _), part in self.parts.items() if part is not None]
        return [(POLYGON_CLASSES.index(kind), ring) for kind, part in parts for ring in part.rings()]

    @property
    def polygons(self) -> Polygons:
        """Polygons of background, ground, shadows and rocks."""
        return [*self.backdrop.polygons, *self.things]

    @cached_property
    def grey(self) -> np.ndarray:
        """Grey map (h, w) uint8."""
        return paint_on(self.backdrop.grey, self.things)


class ViewOutlines:
    """Outlines in one view under any lamp. Rays are cast once. Labels are rows of the label table."""

    def __init__(self, world: TerrainCasters, localised: LocalisedRig, side: str, labels: pd.DataFrame) -> None:
        self._localised = localised
        view = localised.camera(side)
        self._size = view.lens.width, view.lens.height
        self.world = with_domes(world, _domes(world, view, labels))
        width, height = self._size
        self.ids = VisibleIds(self.world, view, np.arange(height) + HALF_PIXEL, np.arange(width) + HALF_PIXEL)
        rings = backdrop(self.ids)
        self._backdrop = Backdrop([(POLYGON_CLASSES.index(name), ring) for name, ring in rings], self._size)
        self._rocks = _convex_shapes(self.ids.rock)
        self._shadows: dict[bytes, dict[int, MaskShape]] = {}  # by lamp
        self._annotated: dict[tuple[bytes, frozenset[LabelShapeKey]], BracketOutlines] = {}

    def drawing(self, light: Light, azimuth: Azimuth, labels: pd.DataFrame) -> BracketOutlines:
        """Return the visible parts of the labels, painted in order: shadows before rocks, then from top to bottom."""
        lamp_position = active_lamp(self.world, self._localised, light, azimuth)
        if lamp_position is None and labels.empty:
            width, height = self._size
            frame = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
            return BracketOutlines({}, Backdrop([(POLYGON_CLASSES.index("background"), frame)], self._size), self._size)
        boxes = _boxes(labels)
        things = dict(zip(shape_keys(labels, boxes), boxes, strict=True))
        content = (b"" if lamp_position is None else lamp_position.tobytes(), frozenset(things))
        if content not in self._annotated:
            order = sorted(things, key=lambda thing: (thing[0] == ROCK, things[thing][3], thing))
            parts = visible_parts([self._shape(thing, things[thing], lamp_position) for thing in order], *self._size)
            self._annotated[content] = BracketOutlines(dict(zip(order, parts, strict=True)), self._backdrop, self._size)
        return self._annotated[content]

    def _shape(self, thing: LabelShapeKey, box: np.ndarray, lamp_position: np.ndarray | None) -> MaskShape:
        """Return the shape of a label before occlusion by other labels."""
        kind, rock, _ = thing
        own_share = OUTLINE_MESH_SHARE if kind == ROCK else OUTLINE_CAST_SHARE
        return fit_shape(self._own_shapes(kind, lamp_position).get(rock), box, own_share)

    def _own_shapes(self, kind: str, lamp_position: np.ndarray | None) -> dict[int, MaskShape]:
        """Return the projected shapes of rocks or of cast shadows."""
        if kind == ROCK:
            return self._rocks
        if lamp_position is None:
            return {}
        if lamp_position.tobytes() not in self._shadows:
            self._shadows[lamp_position.tobytes()] = _convex_shapes(self.ids.shadow_of(self.world, lamp_position))
        return self._shadows[lamp_position.tobytes()]


def _convex_shapes(ids: np.ndarray) -> dict[int, MaskShape]:
    return {rock: convex_shape(shape) for rock, shape in mask_shapes(ids).items()}


def shape_keys(labels: pd.DataFrame, boxes: np.ndarray) -> list[LabelShapeKey]:
    """Return the key of each row of the label table with boxes (n, 4)."""
    return [
        (kind, rock, box.tobytes())
        for kind, rock, box in zip(labels["kind"].tolist(), labels["rock"].tolist(), boxes, strict=True)
    ]


def _boxes(labels: pd.DataFrame) -> np.ndarray:
    return np.ascontiguousarray(labels[BOX_COLUMNS].to_numpy(float).reshape(-1, 4))


def _domes(world: TerrainCasters, view: Camera, labels: pd.DataFrame) -> dict[int, Dome]:
    """Return domes for the labelled rocks of a view without a mesh, from mean boxes."""
    stones = labels[(labels["kind"] == ROCK) & ~labels["rock"].isin([NO_ROCK, *world.bodies])]
    boxes = stones.groupby("rock", as_index=False)[BOX_COLUMNS].mean().to_numpy(float)
    domes = {int(row[0]): fit_dome(world, view, row[1:]) for row in boxes}
    return {rock: dome for rock, dome in domes.items() if dome is not None}


def draw_masks(
    *,
    site: Site,
    terrain: Terrain,
    keys: Sequence[PhotoKey],
    photos: Path,
    table: Path,
    cameras: Path,
    meshes: Path,
    polygons: Path,
    masks: Path,
    preview: Path,
    annotations: Path,
) -> None:
    """Write `polygons`/KEY.txt and `masks`/KEY.png for every key, `preview`, and the COCO file `annotations`.

    All photos of an exposure bracket share the polygons and the grey map, which show the labels of the photo with the
    most labels. The preview is a sheet of the maps of all brackets in colour. The COCO file
    contains the labels of each photo and the file names of existing `photos`.
    """
    labels = tables.read_parquet(table, tables.LABEL_COLUMNS)
    localised = rigs.read_all_localised(cameras)
    for position in sorted({key.position for key in keys} - set(localised)):
        log.warning("terrain %s, position %s: no camera pose, no outlines", terrain_text(terrain), position)
    suns = lamps.read_suns(cameras, localised, site, terrain)
    scene = read_terrain(meshes, terrain, site.sandbox_of(terrain), cameras=cameras)
    world, bare = build_worlds(scene, localised, suns, site.rig_lamp)
    annotated: dict[PhotoKey, list[Annotation]] = {}
    tiles: dict[str, np.ndarray] = {}
    with writing_folder(polygons) as polygon_folder, writing_folder(masks) as mask_folder:
        selected = sorted((key for key in keys if key.position in localised), key=lambda key: (key.view, key))
        for (_, position, camera), members in groupby(selected, key=lambda key: key.view):
            in_view = labels[(labels["position"] == position) & (labels["camera"] == camera)]
            view_world = bare if localised[position].unproven else world
            outlines = ViewOutlines(view_world, localised[position], camera, in_view)
            of_photo = {str(name): rows for name, rows in in_view.groupby("key")}
            for _, bracket_keys in groupby(members, key=lambda key: key.bracket):
                rows_of = {key: of_photo.get(str(key), in_view[:0]) for key in bracket_keys}
                drawing, annotations_of = _draw_bracket(outlines, rows_of, polygon_folder, mask_folder)
                annotated |= annotations_of
                tiles[str(next(iter(rows_of)))] = tile_of_mask(drawing.grey)
    write_mask_sheet(preview, tiles)
    lenses = [rig.rig.left for rig in localised.values()]
    size = (lenses[0].width, lenses[0].height) if lenses else site.images.size
    coco.write_coco(annotations, annotated, site, size, pictures=pictures_at(photos))


def _draw_bracket(
    outlines: ViewOutlines, rows_of: Mapping[PhotoKey, pd.DataFrame], polygon_folder: Path, mask_folder: Path
) -> tuple[BracketOutlines, dict[PhotoKey, list[Annotation]]]:
    """Write the polygons and grey map of an exposure bracket; return the outlines and each photo's annotations."""
    light, azimuth = next((key.light, key.azimuth) for key in rows_of)
    # Most labels, then longest exposure.
    fullest = max(rows_of.items(), key=lambda item: (len(item[1]), item[0].exposure_ms))[1]
    drawing = outlines.drawing(light, azimuth, fullest)
    _write(polygon_folder, mask_folder, list(rows_of), drawing)
    annotations = {}
    for key, rows in rows_of.items():
        photo_drawing, boxes = drawing, _boxes(rows)
        things = shape_keys(rows, boxes)
        if not drawing.parts.keys() >= set(things):  # the photo has different boxes: corrections of one exposure
            photo_drawing = outlines.drawing(light, azimuth, pd.concat([rows, _unseen(fullest, rows)]))
        annotations[key] = _annotations(rows, things, boxes, photo_drawing)
    return drawing, annotations


def _unseen(fullest: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Return rocks that are invisible in a dark photo. They still occlude objects behind them."""
    rocks = fullest[(fullest["kind"] == ROCK) & (fullest["rock"] != NO_ROCK)]
    return rocks[~rocks["rock"].isin(rows.loc[rows["kind"] == ROCK, "rock"])]


def _annotations(
    rows: pd.DataFrame, things: Sequence[LabelShapeKey], boxes: np.ndarray, drawing: BracketOutlines
) -> list[Annotation]:
    """Return the annotations of a photo, without labels that are fully hidden."""
    annotations = []
    labels = zip(things, boxes, rows["source"].tolist(), rows["confidence"].tolist(), strict=True)
    for thing, box, source, confidence in labels:
        if thing in drawing.masks:
            kind, rock, _ = thing
            annotations.append(Annotation(kind, rock, box, drawing.masks[thing], source, confidence))
    return annotations


def _write(polygon_folder: Path, mask_folder: Path, keys: Sequence[PhotoKey], drawing: BracketOutlines) -> None:
    first, *copies = (str(key) for key in keys)
    yolo.write_polygons(polygon_folder / f"{first}.txt", drawing.polygons, drawing.size)
    png.write_png(mask_folder / f"{first}.png", drawing.grey)
    for name in copies:
        shutil.copyfile(polygon_folder / f"{first}.txt", polygon_folder / f"{name}.txt")
        shutil.copyfile(mask_folder / f"{first}.png", mask_folder / f"{name}.png")

"""Shadow labels of a position in any camera: annotated, averaged with cast shadows, or cast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import area, clip, iou, match_gate_px
from polarsim.geometry.masks import Window, windows_of
from polarsim.labels.association import match_ids
from polarsim.labels.bodies import active_lamp
from polarsim.labels.brightness import Brightness
from polarsim.labels.casting import THIN_PX, VisibleIds, fit_to_dark_region, shadow_box
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.label import Label, make_label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.projection import at_border, move_flat
from polarsim.photo import NO_ROCK, NO_SUN, SHADOW, Azimuth, CameraSide, Light

CAST_WEIGHT = 0.3  # weight of a cast shadow relative to an annotation in the other camera
MIN_SHADOW_PX = 12.0  # minimum size of a labelled cast shadow, sqrt(area)
MIN_ROVER_SHADOW_PX = 35.0  # the same under the rover light, whose shadows are mostly hidden slivers
SHADOW_GATE = 2.0  # matching gate of shadows, which are long, relative to the gate of rocks
MAX_EDGE_SHARE, MAX_EDGE_PX = 0.3, 6.0  # maximum distance of matching edges: share of the side of the box; minimum
WALL_ID = NO_ROCK - 1  # id of the sandbox walls in images of occluders
SAME_SHADOW_IOU = 0.2  # minimum IoU of the annotated and the cast box of a shadow to average them


@dataclass(frozen=True)
class CastShadow:
    """Box (4,) of a cast shadow. `in_photo`: the edges were fitted to a dark region of the photo."""

    box: np.ndarray
    in_photo: bool


def mean_shadow(
    annotated: np.ndarray, cut: np.ndarray, cast: CastShadow | None, cast_weight: float, scale: float = 1.0
) -> np.ndarray:
    """Return the mean (4,) of an annotated box (4,) and a cast box, which averages out independent errors.

    Edges `cut` (4,) by the border of the annotated photo are taken from the cast box. Edges of a dark region far from
    the annotated edges are ignored, because dark ground can continue beyond the shadow.

    `cast_weight`: weight of a cast shadow. An annotated shadow and a shadow fitted to a photo have weight 1.
    `scale`: `photo_scale` of the photo.
    """
    if cast is None or iou(annotated[None], cast.box[None])[0, 0] < SAME_SHADOW_IOU:
        return annotated
    weight = 1.0 if cast.in_photo else cast_weight
    mean = (annotated + weight * cast.box) / (1 + weight)
    if cast.in_photo:
        max_distance = np.maximum(MAX_EDGE_SHARE * np.tile(annotated[2:] - annotated[:2], 2), MAX_EDGE_PX * scale)
        mean = np.where(np.abs(cast.box - annotated) < max_distance, mean, annotated)
    return np.where(cut, cast.box, mean)


class PositionShadows:
    """Shadow labels of a position. Rays are cast once per camera and lamp."""

    def __init__(self, rocks: PositionRocks, options: LabelsOptions) -> None:
        self.rocks, self.world, self.options = rocks, rocks.world, options
        self._ids: dict[CameraSide, VisibleIds] = {}
        self._shadow_ids: dict[tuple[CameraSide, bytes], tuple[np.ndarray, dict[int, Window]]] = {}

    def labels(
        self, camera: CameraSide, light: Light, azimuth: Azimuth, rocks: list[Label], brightness: Brightness | None
    ) -> list[Label]:
        """Return the shadows of labelled rocks under a lamp; with a photo, including visible unannotated shadows."""
        # With an unverified pose, the extent of shadows is unknown.
        boxes = {} if self.rocks.in_image else {label.rock: label.box for label in rocks}
        cast = self.cast(camera, light, azimuth, boxes, brightness)
        shadows = self._annotated_or_cast(camera, light, azimuth, cast)
        return shadows if brightness is None else shadows + self._unannotated(camera, azimuth, shadows, cast)

    def _annotated_or_cast(
        self, camera: CameraSide, light: Light, azimuth: Azimuth, cast: Mapping[int, CastShadow]
    ) -> list[Label]:
        """Return shadows annotated in this or else the other camera, averaged with cast shadows; else cast shadows."""
        annotated_here = self.annotated(camera, azimuth)
        if annotated_here is not None:
            occluders = self.occluders(camera, annotated_here, light, azimuth)
            dark = {rock: shadow for rock, shadow in cast.items() if shadow.in_photo}
            inside = np.zeros(4, bool)
            boxes = [
                mean_shadow(box, inside, dark.get(int(rock)), CAST_WEIGHT, self.rocks.scale(camera))
                for rock, box in zip(occluders, annotated_here, strict=True)
            ]
            width = self.rocks.view(camera).lens.width
            return [make_label(SHADOW, rock, "seed", box, width) for rock, box in zip(occluders, boxes, strict=True)]
        other: CameraSide = "R" if camera == "L" else "L"
        annotated = self.annotated(other, azimuth)
        if annotated is None:
            return self._cast_labels(camera, azimuth, cast)
        occluders = self.occluders(other, annotated, light, azimuth)
        moved = move_flat(self.world, self.rocks.view(other), self.rocks.view(camera), annotated)
        boxes = [
            mean_shadow(box, cut, cast.get(int(rock)), CAST_WEIGHT, self.rocks.scale(camera))
            for rock, box, cut in zip(occluders, moved, at_border(annotated, self.rocks.view(other).size), strict=True)
        ]
        return [self.rocks.moved_label(SHADOW, rock, camera, box) for rock, box in zip(occluders, boxes, strict=True)]

    def _unannotated(
        self, camera: CameraSide, azimuth: Azimuth, shadows: list[Label], cast: Mapping[int, CastShadow]
    ) -> list[Label]:
        """Return unannotated shadows visible in the photo that do not overlap with `shadows`."""
        labelled = {label.rock for label in shadows}
        occupied = np.array([label.box for label in shadows]).reshape(-1, 4)
        unlabelled = {rock: shadow for rock, shadow in cast.items() if shadow.in_photo and rock not in labelled}
        return [
            label
            for label in self._cast_labels(camera, azimuth, unlabelled)
            if iou(label.box[None], occupied).max(initial=0.0) < SAME_SHADOW_IOU
        ]

    def _cast_labels(self, camera: CameraSide, azimuth: Azimuth, cast: Mapping[int, CastShadow]) -> list[Label]:
        by_rover_light = azimuth == NO_SUN
        min_px = (MIN_ROVER_SHADOW_PX if by_rover_light else MIN_SHADOW_PX) * self.rocks.scale(camera)
        large = {rock: shadow.box for rock, shadow in cast.items() if np.sqrt(area(shadow.box)) >= min_px}
        size = self.rocks.view(camera).size
        return [
            make_label(SHADOW, rock, "cast", clip(box, *size), int(size[0]), by_rover_light=by_rover_light)
            for rock, box in large.items()
        ]

    def annotated(self, camera: CameraSide, azimuth: Azimuth) -> np.ndarray | None:
        annotated = self.rocks.annotated.get((camera, azimuth))
        return annotated.shadows if annotated is not None else None

    def occluders(self, camera: CameraSide, boxes: np.ndarray, light: Light, azimuth: Azimuth) -> np.ndarray:
        """Return the rock (n,) that casts each annotated shadow, matched by the cast shadows of all rocks."""
        cast = self.cast(camera, light, azimuth, dict.fromkeys(self.world.bodies))
        expected = np.array([shadow.box for shadow in cast.values()]).reshape(-1, 4)
        gate_px = SHADOW_GATE * match_gate_px(self.rocks.view(camera).lens.width)
        return match_ids(boxes, expected, list(cast), gate_px, smallest_iou=0.1)

    def cast(
        self,
        camera: CameraSide,
        light: Light,
        azimuth: Azimuth,
        rock_boxes: Mapping[int, np.ndarray | None],
        brightness: Brightness | None = None,
    ) -> dict[int, CastShadow]:
        """Return the boxes of the shadows of rocks as annotators would draw them, by rock.

        `rock_boxes` are the labels of the rocks. With `brightness`, shadows of walls hide shadows of rocks. Without a
        photo, walls and lamps are too uncertain.
        """
        step, lamp_position = self.options.ray_step_px, active_lamp(self.world, self.rocks.localised, light, azimuth)
        thin = THIN_PX * self.rocks.scale(camera)
        assert lamp_position is not None
        ids, shadow, windows = self._visible_shadows(camera, lamp_position)
        if brightness is not None:
            shadow = np.where(self._shaded_by_walls(ids, lamp_position), WALL_ID, shadow)
            windows = windows_of(shadow)
        shadows = {}
        for rock, rock_box in sorted(rock_boxes.items()):
            slivers = azimuth != NO_SUN or rock_box is None  # annotators omit slivers under the rover light
            box = shadow_box(shadow, rock, rock_box, step, windows, thin, slivers=slivers)
            if box is None:
                continue
            dark = (
                fit_to_dark_region(box, shadow, ids.rock, step, rock, brightness)
                if brightness and rock_box is not None
                else None
            )
            if dark is None and rock_box is not None:
                projected = self.rocks.projected(camera, rock) if rock in self.world.bodies else None
                mesh_box, scale = projected.box if projected else rock_box, self.rocks.px_per_m(camera, rock)
                box = self.rocks.annotator.draw_shadow(box, rock_box, mesh_box, scale)
            if area(box) > 0:
                shadows[rock] = CastShadow(box if dark is None else dark, dark is not None)
        return shadows

    def _shaded_by_walls(self, ids: VisibleIds, lamp_position: np.ndarray) -> np.ndarray:
        """Return a mask (rows, columns) of ground in the shadow of a wall."""
        sandbox = self.world.sandbox
        return np.zeros(ids.shape, bool) if sandbox is None else ids.clearance(sandbox, lamp_position) < 0

    def _visible_shadows(
        self, camera: CameraSide, lamp_position: np.ndarray
    ) -> tuple[VisibleIds, np.ndarray, dict[int, Window]]:
        """Return the visible rocks of a camera, the occluder of a lamp (3,) for each pixel, and its `windows_of`."""
        view, step = self.rocks.view(camera), self.options.ray_step_px
        if camera not in self._ids:
            width, height = view.size
            self._ids[camera] = VisibleIds(
                self.world, view, np.arange(step / 2, height, step), np.arange(step / 2, width, step)
            )
        ids = self._ids[camera]
        if (camera, lamp_position.tobytes()) not in self._shadow_ids:
            shadow = np.where(ids.rock == NO_ROCK, ids.shadow_of(self.world, lamp_position), NO_ROCK)
            self._shadow_ids[camera, lamp_position.tobytes()] = shadow, windows_of(shadow)
        return ids, *self._shadow_ids[camera, lamp_position.tobytes()]

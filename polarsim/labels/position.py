"""Labels of one position of the tripod, for any camera and lamp: what was drawn there, fused, projected and cast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import area, clip, iou
from polarsim.labels.confidence import confidence
from polarsim.labels.edges import snapped
from polarsim.labels.habits import as_people_draw
from polarsim.labels.identity import match_boxes
from polarsim.labels.known import Known
from polarsim.labels.options import LabelsOptions
from polarsim.labels.photos import Brightness, Photos
from polarsim.labels.seeds import Drawn
from polarsim.labels.shadows import Ids, lamp, shadow_box
from polarsim.labels.view import ProjectedRock, View, move_flat, move_rocks, project_rock
from polarsim.photo import NO_ROCK, ROCK, SHADOW, Azimuth, Camera, Light

SHADOW_GATE = 2.0  # shadows are long: they are matched within this many times the gate of rocks
BORDER_PX = 2.0  # an edge this near to the photo's border is where the photo ends
SAME_SHADOW = 0.2  # least IoU of a drawn and a cast box of one shadow for both to be believed


@dataclass(frozen=True)
class Label:
    """One box (4,) of a photo, and where it comes from: seed, fused, projected or cast."""

    kind: str
    rock: int
    source: str
    confidence: float
    box: np.ndarray


@dataclass(frozen=True)
class CastShadow:
    """The box (4,) around a shadow that geometry casts, and whether its edges are those of a dark region in a photo."""

    box: np.ndarray
    in_photo: bool


class PositionLabels:
    """Labels of one position of the tripod; every camera's rays are cast once, every lamp's shadows too."""

    def __init__(self, known: Known, position: str, options: LabelsOptions, photos: Photos | None = None) -> None:
        self.world, self.options, self.photos = known.world, options, photos
        self.position, self.placed = position, known.placed[position]
        self.drawn = known.seeds.get(position, {})
        self.azimuths = {azimuth for _, azimuth in self.drawn}
        self.tracks, self.ids = known.tracks.get(position, []), known.rocks.get(position, np.zeros(0, int))
        self._fused_boxes: dict[Camera, np.ndarray] = {}
        self._projections: dict[tuple[Camera, int], ProjectedRock | None] = {}
        self._seen: dict[Camera, Ids] = {}
        self._shadow_ids: dict[tuple[Camera, bytes], np.ndarray] = {}

    def labels(self, camera: Camera, light: Light, azimuth: Azimuth) -> list[Label]:
        """What the photos of a camera under a lamp show, longest exposure.

        Where there are photos to tell what is seen, also what was not drawn: people forget, and draw by azimuth.
        """
        rocks, shadows = self._rocks(camera, azimuth), []
        has_photo = self._brightness(camera, light, azimuth) is not None
        if has_photo:
            rocks += self._undrawn_rocks(camera, rocks)
        if lamp(self.world, self.view(camera), light, azimuth) is not None:
            cast = self._cast(camera, light, azimuth, {label.rock: label.box for label in rocks})
            shadows = self._shadows(camera, light, azimuth, cast)
            if has_photo:
                shadows += self._undrawn_shadows(azimuth, shadows, cast)
        return [label for label in rocks + shadows if area(label.box) > 0]

    def view(self, camera: Camera) -> View:
        return View(self.placed, camera)

    def _rocks(self, camera: Camera, azimuth: Azimuth) -> list[Label]:
        if not self.drawn:
            return self._projected_rocks(camera)
        if (camera, azimuth) in self.drawn:
            boxes, shown = self.drawn[camera, azimuth].rocks, [(camera, azimuth) in track.rows for track in self.tracks]
            own = [(row, boxes[self.tracks[row].rows[camera, azimuth]]) for row in np.flatnonzero(shown)]
            return [self._label(ROCK, self.ids[row], "seed", 1.0, box) for row, box in own]
        if azimuth in self.azimuths:
            share = np.array([float(azimuth in track.azimuths) for track in self.tracks])
        else:
            share = np.array([len(track.azimuths) for track in self.tracks]) / len(self.azimuths)
        boxes = self._fused(camera)
        chosen = [row for row in range(len(self.tracks)) if share[row] >= self.options.presence]
        return [self._label(ROCK, self.ids[row], "fused", float(share[row]), boxes[row]) for row in chosen]

    def _fused(self, camera: Camera) -> np.ndarray:
        """(tracks, 4) mean of each track's boxes, moved into a camera, and of its rock's mesh there with its weight."""
        if camera not in self._fused_boxes:
            total, weight = np.zeros((len(self.tracks), 4)), np.zeros((len(self.tracks), 4))
            shown = [self._mesh_box(camera, int(rock)) for rock in self.ids]
            for source in sorted({own for own, _ in self.drawn}):
                of_source = [[s for s in track.rows if s[0] == source] for track in self.tracks]
                rows = np.flatnonzero([bool(sights) for sights in of_source])
                means = [
                    np.mean([self.drawn[s].rocks[self.tracks[row].rows[s]] for s in of_source[row]], axis=0)
                    for row in rows
                ]
                boxes = np.array(means).reshape(-1, 4)
                moved = self._moved(boxes, self.ids[rows], source, camera)
                count = np.array([len(of_source[row]) for row in rows])[:, None]
                meshes = [self._mesh_box(source, int(rock)) for rock in self.ids[rows]]
                seen = np.array([box if mesh is None else mesh for box, mesh in zip(boxes, meshes, strict=True)])
                cut = self._cut(boxes, source) | self._cut(seen.reshape(-1, 4), source)
                whole = ~cut | (source == camera)  # the border of one photo is none of the other's
                whole |= np.array([shown[row] is None for row in rows], bool)[:, None]
                total[rows] += count * whole * moved
                weight[rows] += count * whole
            for row, box in enumerate(shown):
                if box is not None:
                    mesh = np.where(weight[row] > 0, self.options.mesh_weight, 1.0)
                    total[row] += mesh * box
                    weight[row] += mesh
            self._fused_boxes[camera] = total / weight
        return self._fused_boxes[camera]

    def _mesh_box(self, camera: Camera, rock: int) -> np.ndarray | None:
        """(4,) of a rock's mesh in a camera that sees enough of it."""
        body = self.world.bodies.get(rock)
        shown = self._projected(camera, rock) if body is not None and body.meshed else None
        return shown.box if shown is not None and shown.seen >= self.options.min_seen else None

    def _cut(self, boxes: np.ndarray, camera: Camera) -> np.ndarray:
        """(n, 4) bool: edges of boxes (n, 4) at the border of a camera's photo, where things go on unseen."""
        return np.concatenate([boxes[:, :2] <= BORDER_PX, boxes[:, 2:] >= self.view(camera).size - BORDER_PX], axis=1)

    def _moved(self, boxes: np.ndarray, rocks: np.ndarray, source: Camera, target: Camera) -> np.ndarray:
        if source == target:
            return boxes
        return move_rocks(self.world, self.view(source), self.view(target), boxes, rocks)

    def _projected(self, camera: Camera, rock: int) -> ProjectedRock | None:
        """A body as a person would draw it."""
        if (camera, rock) not in self._projections:
            shown = project_rock(self.world, self.view(camera), rock)
            margin = np.array([-1, -1, 1, 1]) * self.options.rock_margin_px
            self._projections[camera, rock] = (
                ProjectedRock(clip(shown.box + margin, *self.view(camera).size), shown.seen) if shown else None
            )
        return self._projections[camera, rock]

    def _projected_rocks(self, camera: Camera) -> list[Label]:
        labels = []
        for rock in sorted(self.world.bodies):
            shown = self._projected(camera, rock)
            if shown and shown.seen >= self.options.min_seen and np.sqrt(area(shown.box)) >= self.options.min_rock_px:
                labels.append(self._label(ROCK, rock, "projected", 1.0, shown.box))
        return labels

    def _undrawn_rocks(self, camera: Camera, rocks: list[Label]) -> list[Label]:
        """Rocks that other azimuths, other positions or scans know, as far as no label shows them yet."""
        known = {label.rock for label in rocks}
        fused = self._fused(camera) if self.tracks else np.zeros((0, 4))
        elsewhere = {int(rock): box for rock, box in zip(self.ids, fused, strict=True) if rock not in known}
        taken = np.array([*(label.box for label in rocks), *elsewhere.values()]).reshape(-1, 4)
        share = {int(rock): len(track.azimuths) for rock, track in zip(self.ids, self.tracks, strict=True)}
        found = [
            self._label(ROCK, rock, "fused", share[rock] / len(self.azimuths), box) for rock, box in elsewhere.items()
        ]
        for label in self._projected_rocks(camera):
            drawn_as_another = iou(label.box[None], taken).max(initial=0.0) >= self.options.same_rock_iou
            if label.rock not in known and label.rock not in elsewhere and not drawn_as_another:
                found.append(label)
        return found

    def _shadows(self, camera: Camera, light: Light, azimuth: Azimuth, cast: Mapping[int, CastShadow]) -> list[Label]:
        """Shadows as drawn in this camera, or drawn in the other and averaged with the cast ones (4,), or cast."""
        own = self._shadows_drawn(camera, azimuth)
        if own is not None:
            throwers = self._throwers(camera, own, light, azimuth)
            return [self._label(SHADOW, rock, "seed", 1.0, box) for rock, box in zip(throwers, own, strict=True)]
        other: Camera = "R" if camera == "L" else "L"
        drawn = self._shadows_drawn(other, azimuth)
        if drawn is None:
            return self._cast_labels(azimuth, cast)
        throwers = self._throwers(other, drawn, light, azimuth)
        moved = move_flat(self.world, self.view(other), self.view(camera), drawn)
        boxes = [
            self._mean_shadow(box, cut, cast.get(int(rock)))
            for rock, box, cut in zip(throwers, moved, self._cut(drawn, other), strict=True)
        ]
        return [self._label(SHADOW, rock, "fused", 1.0, box) for rock, box in zip(throwers, boxes, strict=True)]

    def _undrawn_shadows(self, azimuth: Azimuth, shadows: list[Label], cast: Mapping[int, CastShadow]) -> list[Label]:
        """Shadows that the photo shows and nobody drew, each of a rock without one, where no other was drawn."""
        known = {label.rock for label in shadows}
        taken = np.array([label.box for label in shadows]).reshape(-1, 4)
        found = {rock: shadow for rock, shadow in cast.items() if shadow.in_photo and rock not in known}
        return [
            label
            for label in self._cast_labels(azimuth, found)
            if iou(label.box[None], taken).max(initial=0.0) < SAME_SHADOW
        ]

    def _cast_labels(self, azimuth: Azimuth, cast: Mapping[int, CastShadow]) -> list[Label]:
        least = self.options.min_rover_shadow_px if azimuth == "no" else self.options.min_shadow_px
        large = {rock: shadow.box for rock, shadow in cast.items() if np.sqrt(area(shadow.box)) >= least}
        return [self._label(SHADOW, rock, "cast", 1.0, box) for rock, box in large.items()]

    def _shadows_drawn(self, camera: Camera, azimuth: Azimuth) -> np.ndarray | None:
        drawn: Drawn | None = self.drawn.get((camera, azimuth))
        return drawn.shadows if drawn is not None else None

    def _mean_shadow(self, drawn: np.ndarray, cut: np.ndarray, cast: CastShadow | None) -> np.ndarray:
        """A drawn box (4,), moved to the other camera, and the cast one: errors of pen and of geometry even out.

        A box with edges from the photo needs no mean, nor does an edge that was cut (4,) by the drawn photo's border.
        """
        if cast is None or iou(drawn[None], cast.box[None])[0, 0] < SAME_SHADOW:
            return drawn
        weight = self.options.cast_weight
        mean = (drawn + weight * cast.box) / (1 + weight)
        return cast.box if cast.in_photo else np.where(cut, cast.box, mean)

    def _throwers(self, camera: Camera, boxes: np.ndarray, light: Light, azimuth: Azimuth) -> np.ndarray:
        """(n,) rock that throws each shadow drawn in a camera's photo, by the shadows that the bodies cast there."""
        cast = self._cast(camera, light, azimuth, dict.fromkeys(self.world.bodies))
        expected = np.array([shadow.box for shadow in cast.values()]).reshape(-1, 4)
        rows = match_boxes(boxes, expected, SHADOW_GATE * self.options.match_gate_px, smallest_iou=0.1)
        return np.where(rows >= 0, np.array([*cast, NO_ROCK])[rows], NO_ROCK)

    def _cast(
        self, camera: Camera, light: Light, azimuth: Azimuth, rock_boxes: Mapping[int, np.ndarray | None]
    ) -> dict[int, CastShadow]:
        """What a person would draw around the shadows of rocks, whose own boxes are given, by rock."""
        view, step = self.view(camera), self.options.ray_step_px
        place = lamp(self.world, view, light, azimuth)
        assert place is not None
        if camera not in self._seen:
            width, height = view.size
            self._seen[camera] = Ids(
                self.world, view, np.arange(step / 2, height, step), np.arange(step / 2, width, step)
            )
        ids = self._seen[camera]
        if (camera, place.tobytes()) not in self._shadow_ids:
            self._shadow_ids[camera, place.tobytes()] = np.where(
                ids.rock == NO_ROCK, ids.shadow_of(self.world, place), NO_ROCK
            )
        shadow = self._shadow_ids[camera, place.tobytes()]
        brightness = self._brightness(camera, light, azimuth)
        found = {}
        for rock, rock_box in sorted(rock_boxes.items()):
            box = shadow_box(shadow, rock, rock_box, step)
            if box is None:
                continue
            dark = (
                snapped(box, shadow, ids.rock, step, rock, brightness) if brightness and rock_box is not None else None
            )
            if dark is None and rock_box is not None:
                shown = self._projected(camera, rock) if rock in self.world.bodies else None
                box = as_people_draw(box, rock_box, shown.box if shown else rock_box, self._px_per_m(camera, rock))
            if area(box) > 0:
                found[rock] = CastShadow(box if dark is None else dark, dark is not None)
        return found

    def _brightness(self, camera: Camera, light: Light, azimuth: Azimuth) -> Brightness | None:
        """What photos show under a Sun lamp: without rover light where there are such, for it brightens shadows."""
        if self.photos is None:
            return None
        lights: tuple[Light, ...] = (light,) if azimuth == "no" else ("off", "on")
        sets = (self.photos.brightness((self.position, camera, own, azimuth)) for own in lights)
        return next((brightness for brightness in sets if brightness is not None), None)

    def _px_per_m(self, camera: Camera, rock: int) -> float:
        view, body = self.view(camera), self.world.bodies.get(rock)
        place = body.vertices.mean(axis=0) if body is not None else np.zeros(3)
        return view.focal_px / float(np.linalg.norm(place - view.centre))

    def _label(self, kind: str, rock: int, source: str, share: float, box: np.ndarray) -> Label:
        box = box if source == "seed" else clip(box)
        size = float(np.sqrt(area(box)))
        return Label(kind, int(rock), source, round(confidence(kind, source, share, size), 3), box)

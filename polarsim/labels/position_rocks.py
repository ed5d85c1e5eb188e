"""Rocks of one position of the tripod in any camera's photos: as drawn, fused of several drawings, or projected."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.boxes import area, clip, iou
from polarsim.labels.fusion import mesh_weights
from polarsim.labels.known import Known
from polarsim.labels.label import Label, label_of
from polarsim.labels.options import LabelsOptions
from polarsim.labels.view import ProjectedRock, View, at_border, move_rocks, project_rock
from polarsim.photo import ROCK, Azimuth, Camera


class PositionRocks:
    """Rocks of one position; what photos share is computed once."""

    def __init__(self, known: Known, position: str, options: LabelsOptions) -> None:
        self.in_image = position in known.apart  # nobody knows where its cameras stood
        known = known.of(position)
        self.world, self.options = known.world, options
        self.placed = known.placed[position]
        self.drawn = known.seeds.get(position, {})
        self.azimuths = {azimuth for _, azimuth in self.drawn}
        self.tracks, self.ids = known.tracks.get(position, []), known.rocks.get(position, np.zeros(0, int))
        self._fused_boxes: dict[Camera, np.ndarray] = {}
        self._projections: dict[tuple[Camera, int], ProjectedRock | None] = {}

    def view(self, camera: Camera) -> View:
        return View(self.placed, camera)

    def labels(self, camera: Camera, azimuth: Azimuth) -> list[Label]:
        """Rocks that people drew, or would have drawn, under a lamp."""
        if not self.drawn:
            return self._projected_rocks(camera)
        if (camera, azimuth) in self.drawn:
            boxes, shown = self.drawn[camera, azimuth].rocks, [(camera, azimuth) in track.rows for track in self.tracks]
            own = [(row, boxes[self.tracks[row].rows[camera, azimuth]]) for row in np.flatnonzero(shown)]
            return [label_of(ROCK, self.ids[row], "seed", box) for row, box in own]
        if azimuth in self.azimuths:
            share = np.array([float(azimuth in track.azimuths) for track in self.tracks])
        else:
            share = np.array([len(track.azimuths) for track in self.tracks]) / len(self.azimuths)
        boxes = self._fused(camera)
        chosen = [row for row in range(len(self.tracks)) if share[row] >= self.options.presence]
        source = self.moved_source(camera)
        return [label_of(ROCK, self.ids[row], source, boxes[row], float(share[row])) for row in chosen]

    def moved_source(self, camera: Camera) -> str:
        """Source of labels that other drawings tell: `shifted` where no pose says how far things move to a camera."""
        drawn_here = any(own == camera for own, _ in self.drawn)
        return "shifted" if self.in_image and not drawn_here else "fused"

    def drawn_azimuths(self, rock: int) -> set[Azimuth]:
        """Under which lamps people drew a rock here."""
        return {azimuth for row in np.flatnonzero(self.ids == rock) for azimuth in self.tracks[row].azimuths}

    def undrawn(self, camera: Camera, rocks: list[Label]) -> list[Label]:
        """Rocks that other azimuths, other positions or scans know, as far as no label shows them yet."""
        known = {label.rock for label in rocks}
        fused = self._fused(camera) if self.tracks else np.zeros((0, 4))
        elsewhere = {int(rock): box for rock, box in zip(self.ids, fused, strict=True) if rock not in known}
        taken = np.array([*(label.box for label in rocks), *elsewhere.values()]).reshape(-1, 4)
        share = {int(rock): len(track.azimuths) for rock, track in zip(self.ids, self.tracks, strict=True)}
        source = self.moved_source(camera)
        found = [label_of(ROCK, rock, source, box, share[rock] / len(self.azimuths)) for rock, box in elsewhere.items()]
        for label in self._projected_rocks(camera):
            drawn_as_another = iou(label.box[None], taken).max(initial=0.0) >= self.options.same_rock_iou
            if label.rock not in known and label.rock not in elsewhere and not drawn_as_another:
                found.append(label)
        return found

    def projected(self, camera: Camera, rock: int) -> ProjectedRock | None:
        """A body as a person would draw it."""
        if (camera, rock) not in self._projections:
            shown = project_rock(self.world, self.view(camera), rock)
            margin = np.array([-1, -1, 1, 1]) * self.options.rock_margin_px
            self._projections[camera, rock] = (
                ProjectedRock(clip(shown.box + margin, *self.view(camera).size), shown.seen) if shown else None
            )
        return self._projections[camera, rock]

    def px_per_m(self, camera: Camera, rock: int) -> float:
        """Scale of a camera's photo at a rock."""
        view, body = self.view(camera), self.world.bodies.get(rock)
        place = body.centre if body is not None else np.zeros(3)
        return view.focal_px / float(np.linalg.norm(place - view.centre))

    def _fused(self, camera: Camera) -> np.ndarray:
        """(tracks, 4) mean of each track's boxes, moved into a camera, and of its mesh there as far as that fits."""
        if camera not in self._fused_boxes:
            total, weight = np.zeros((len(self.tracks), 4)), np.zeros((len(self.tracks), 4))
            shown = [self._mesh_box(camera, int(rock)) for rock in self.ids]
            for source in sorted({own for own, _ in self.drawn}):
                rows, count, boxes = self._drawn_means(source)
                moved = self._moved(boxes, self.ids[rows], source, camera)
                # The border of one photo is none of the other's, where a mesh tells how things go on.
                has_mesh = np.array([shown[row] is not None for row in rows], bool)[:, None]
                cut = self._cut(boxes, self.ids[rows], source) & has_mesh & (source != camera)
                total[rows] += count * ~cut * moved
                weight[rows] += count * ~cut
            meshed = np.flatnonzero([box is not None for box in shown])
            mesh = np.array([shown[row] for row in meshed]).reshape(-1, 4)
            count, drawn = weight[meshed], total[meshed] / np.maximum(weight[meshed], 1)
            own = mesh_weights(drawn, count, mesh, self.options.mesh_weight)
            total[meshed] += own * mesh
            weight[meshed] += own
            self._fused_boxes[camera] = total / weight
        return self._fused_boxes[camera]

    def _drawn_means(self, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Tracks (n,) that a camera's drawings show, in how many of them each (n, 1), and its mean box there (n, 4)."""
        boxes = [
            [self.drawn[sight].rocks[row] for sight, row in track.rows.items() if sight[0] == camera]
            for track in self.tracks
        ]
        rows = np.flatnonzero([bool(own) for own in boxes])
        count = np.array([len(boxes[row]) for row in rows], int)[:, None]
        return rows, count, np.array([np.mean(boxes[row], axis=0) for row in rows]).reshape(-1, 4)

    def _cut(self, boxes: np.ndarray, rocks: np.ndarray, camera: Camera) -> np.ndarray:
        """(n, 4) bool: edges that a photo's border cuts, of boxes (n, 4) or of the meshes of their rocks (n,)."""
        meshes = [self._mesh_box(camera, int(rock)) for rock in rocks]
        seen = np.array([box if mesh is None else mesh for box, mesh in zip(boxes, meshes, strict=True)])
        size = self.view(camera).size
        return at_border(boxes, size) | at_border(seen.reshape(-1, 4), size)

    def _mesh_box(self, camera: Camera, rock: int) -> np.ndarray | None:
        """(4,) of a rock's mesh in a camera that sees enough of it."""
        body = self.world.bodies.get(rock)
        shown = self.projected(camera, rock) if body is not None and body.meshed else None
        return shown.box if shown is not None and shown.seen >= self.options.min_seen else None

    def _moved(self, boxes: np.ndarray, rocks: np.ndarray, source: Camera, target: Camera) -> np.ndarray:
        if source == target:
            return boxes
        return move_rocks(self.world, self.view(source), self.view(target), boxes, rocks)

    def _projected_rocks(self, camera: Camera) -> list[Label]:
        labels = []
        for rock in sorted(self.world.bodies):
            shown = self.projected(camera, rock)
            if shown and shown.seen >= self.options.min_seen and np.sqrt(area(shown.box)) >= self.options.min_rock_px:
                labels.append(label_of(ROCK, rock, "projected", shown.box))
        return labels

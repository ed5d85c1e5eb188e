"""Rock labels of a position in any camera: annotated, fused from several annotations, or projected from meshes.

A missing annotation is evidence against a rock only if the photo could show the rock: inside the image and lit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from polarsim.geometry.boxes import area, clip, iou
from polarsim.geometry.camera import Camera
from polarsim.labels.annotator import MIN_PROBABILITY, Annotator, read_annotator, rover_light_terms
from polarsim.labels.association import SAME_ROCK_IOU, TerrainRocks
from polarsim.labels.edge_weights import mesh_weights
from polarsim.labels.label import Label, make_label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.projection import ProjectedRock, at_border, move_rocks, project_rock
from polarsim.labels.seeds import sort_by_camera
from polarsim.labels.visibility import lit_rock_share
from polarsim.photo import NO_SUN, ROCK, Azimuth, CameraSide, photo_scale

# Fitted to the published labels; `benchmarks/transfers.py` measures the transfer to terrains left out of the fit.
# A rock gets labels at azimuths without seeds if it is annotated in this share of the seeded azimuths that light it.
ANNOTATED_SHARE = 0.6
SAME_LAMP_WEIGHT = 2.0  # weight in a fused box of an annotation under the same lamp; 1 under a different lamp
MESH_WEIGHT = 1.0  # weight in a fused box of a mesh edge that agrees with the annotations; an annotation has 1
ROCK_MARGIN_PX = 1.0  # margin of annotated boxes around projected meshes
UNANNOTATED_LAMP = 0.2  # weight in the confidence of a lamp without annotations; 1 for an annotation without the rock
MIN_VISIBLE_SHARE = 0.2  # minimum visible share of the projection of a labelled rock
MIN_LIT_SHARE = 0.1  # minimum lit share of a rock for annotators to see it
MIN_LIGHTING_LAMPS = 3  # minimum number of lamps that light a rock annotated under a single lamp, to drop the rock
MIN_SHARE_IN_VIEW = 0.5  # minimum share of a rock inside a photo to expect an annotation there


class PositionRocks:
    """Rock labels of a position. Results shared by several photos are computed once."""

    def __init__(
        self, terrain_rocks: TerrainRocks, position: str, options: LabelsOptions, annotator: Annotator | None = None
    ) -> None:
        self.in_image = position in terrain_rocks.unverified  # unverified camera pose
        self._terrain_rocks, self._position = terrain_rocks.of(position), position
        terrain_rocks = self._terrain_rocks
        self.world, self.options, self.annotator = terrain_rocks.world, options, annotator or read_annotator()
        self.localised = terrain_rocks.localised[position]
        self.annotated = terrain_rocks.seeds.get(position, {})
        self.azimuths = {azimuth for _, azimuth in self.annotated}
        self.tracks = terrain_rocks.tracks.get(position, [])
        self.ids = terrain_rocks.rocks.get(position, np.zeros(0, int))
        self._fused_boxes: dict[tuple[CameraSide, Azimuth | None], np.ndarray] = {}
        self._lit: dict[tuple[int, Azimuth], bool] = {}
        self._projections: dict[tuple[CameraSide, int], ProjectedRock | None] = {}

    def view(self, camera: CameraSide) -> Camera:
        return self.localised.camera(camera)

    def scale(self, camera: CameraSide) -> float:
        """Return the `photo_scale` of the photos of a camera."""
        return photo_scale(self.view(camera).lens.width)

    def labels(self, camera: CameraSide, azimuth: Azimuth) -> list[Label]:
        """Return rocks that are annotated, or would be annotated, under a lamp."""
        if not self.annotated:
            return self._projected_rocks(camera)
        if (camera, azimuth) in self.annotated:
            boxes = self.annotated[camera, azimuth].rocks
            rows = [track.rows.get((camera, azimuth)) for track in self.tracks]
            annotated_rows = [(rock, row) for rock, row in zip(self.ids, rows, strict=True) if row is not None]
            width = self.view(camera).lens.width
            return [make_label(ROCK, rock, "seed", boxes[row], width) for rock, row in annotated_rows]
        boxes = self.fused(camera, azimuth)
        if azimuth in self.azimuths:
            chosen = [
                row for row, track in enumerate(self.tracks) if azimuth in track.azimuths and not self._is_doubtful(row)
            ]
            share = np.ones(len(self.tracks))
        elif azimuth != NO_SUN:
            annotated = np.array([len(track.azimuths) for track in self.tracks])
            possible = np.array([len(self._possible_azimuths(row)) for row in range(len(self.tracks))])
            chosen = np.flatnonzero(annotated >= ANNOTATED_SHARE * possible).tolist()
            share = annotated / (possible + UNANNOTATED_LAMP)
        else:
            return self._by_rover_light(camera, boxes)
        labels = [self.moved_label(ROCK, self.ids[row], camera, boxes[row], float(share[row])) for row in chosen]
        return labels + self._beyond_border(camera, azimuth, boxes)

    def rover_light_terms(self, camera: CameraSide, row: int) -> np.ndarray:
        """Return the `rover_light_terms` (t,) of a track in photos without a Sun lamp."""
        rock, suns = int(self.ids[row]), self.azimuths - {NO_SUN}
        share = len(self.tracks[row].azimuths & suns) / max(len(suns), 1)
        share_elsewhere = self._share_elsewhere(rock)
        size = float(np.sqrt(area(clip(self.fused(camera)[row], *self.view(camera).size)))) / self.scale(camera)
        distance = self.view(camera).lens.fx / self.px_per_m(camera, rock)
        return rover_light_terms(share, share if share_elsewhere is None else share_elsewhere, size, distance)

    def _by_rover_light(self, camera: CameraSide, boxes: np.ndarray) -> list[Label]:
        """Return rocks that annotators would annotate without a Sun lamp."""
        labels = []
        for row, box in enumerate(boxes):
            probability = self.annotator.rock_probability(self.rover_light_terms(camera, row))
            if probability >= MIN_PROBABILITY:
                label = self.moved_label(ROCK, self.ids[row], camera, box)
                labels.append(replace(label, confidence=round(probability, 3)))
        return labels

    def _possible_azimuths(self, row: int) -> set[Azimuth]:
        """Return the azimuths whose annotations contain the rock of a track or could contain it."""
        return self.tracks[row].azimuths | self._lighting(int(self.ids[row]))

    def _lighting(self, rock: int) -> set[Azimuth]:
        """Return the annotated azimuths whose lamp lights a rock."""
        return {azimuth for azimuth in self.azimuths if self._is_lit(rock, azimuth)}

    def _is_lit(self, rock: int, azimuth: Azimuth) -> bool:
        if azimuth == NO_SUN or self.in_image:  # occluders of the lamp are unknown for an unverified pose
            return azimuth != NO_SUN
        if (rock, azimuth) not in self._lit:
            self._lit[rock, azimuth] = lit_rock_share(self.world, rock, azimuth) > MIN_LIT_SHARE
        return self._lit[rock, azimuth]

    def _is_doubtful(self, row: int) -> bool:
        """Return whether a rock is annotated at one azimuth only and at no other position, though it is lit at more."""
        single = len(self.tracks[row].azimuths) == 1 and len(self._possible_azimuths(row)) >= MIN_LIGHTING_LAMPS
        return single and self._share_elsewhere(int(self.ids[row])) == 0

    def _share_elsewhere(self, rock: int) -> float | None:
        """Return the annotated share of Sun azimuths of a rock at other positions; None if they cannot show it."""
        shares = []
        for position, ids in self._terrain_rocks.rocks.items():
            if position != self._position:
                tracks = self._terrain_rocks.tracks[position]
                annotated = {azimuth for row in np.flatnonzero(ids == rock) for azimuth in tracks[row].azimuths}
                if annotated or self._in_view(position, rock):
                    suns = {azimuth for _, azimuth in self._terrain_rocks.seeds[position]} - {NO_SUN}
                    shares.append(len(annotated & suns) / max(len(suns), 1))
        return float(np.mean(shares)) if shares else None

    def _in_view(self, position: str, rock: int) -> bool:
        """Return whether a rock is inside the annotated photos of a position."""
        view = self._terrain_rocks.localised[position].camera(
            sort_by_camera(list(self._terrain_rocks.seeds[position]))[0][0]
        )
        projected = project_rock(self.world, view, rock) if rock in self.world.bodies else None
        return projected is not None and projected.visible_share >= MIN_SHARE_IN_VIEW

    def _beyond_border(self, camera: CameraSide, azimuth: Azimuth, fused: np.ndarray) -> list[Label]:
        """Return lit projected rocks that are outside all annotated photos of this position."""
        labels = []
        for label in self._projected_rocks(camera) if azimuth != NO_SUN else []:
            rock = label.rock
            outside = all(self.projected(side, rock) is None for side, _ in self.annotated)
            annotated_as_another = iou(label.box[None], fused).max(initial=0.0) >= SAME_ROCK_IOU
            if rock not in self.ids and outside and self._is_lit(rock, azimuth) and not annotated_as_another:
                labels.append(label)
        return labels

    def moved_label(self, kind: str, rock: int, camera: CameraSide, box: np.ndarray, share: float = 1.0) -> Label:
        """Return a label moved from other photos: `translated` if the pose for the move is unverified, else `fused`."""
        annotated_here = any(side == camera for side, _ in self.annotated)
        source = "translated" if self.in_image and not annotated_here else "fused"
        size = self.view(camera).size
        known = self.localised.pitch_known
        return make_label(kind, rock, source, clip(box, *size), int(size[0]), share, pitch_known=known)

    def annotated_azimuths(self, rock: int) -> set[Azimuth]:
        """Return the azimuths at which a rock is annotated at this position."""
        return {azimuth for row in np.flatnonzero(self.ids == rock) for azimuth in self.tracks[row].azimuths}

    def unannotated(self, camera: CameraSide, rocks: list[Label]) -> list[Label]:
        """Return rocks known from other azimuths, other positions or scans that are not among the labels `rocks`."""
        labelled = {label.rock for label in rocks}
        fused = self.fused(camera) if self.tracks else np.zeros((0, 4))
        elsewhere = {int(rock): box for rock, box in zip(self.ids, fused, strict=True) if rock not in labelled}
        occupied = np.array([*(label.box for label in rocks), *elsewhere.values()]).reshape(-1, 4)
        share = {int(rock): len(track.azimuths) for rock, track in zip(self.ids, self.tracks, strict=True)}
        labels = [
            self.moved_label(ROCK, rock, camera, box, share[rock] / len(self.azimuths))
            for rock, box in elsewhere.items()
        ]
        for label in self._projected_rocks(camera):
            annotated_as_another = iou(label.box[None], occupied).max(initial=0.0) >= SAME_ROCK_IOU
            if label.rock not in labelled and label.rock not in elsewhere and not annotated_as_another:
                labels.append(label)
        return labels

    def projected(self, camera: CameraSide, rock: int) -> ProjectedRock | None:
        """Return the projection of a rock with the margin of annotators; None if the rock is not visible."""
        if (camera, rock) not in self._projections:
            projection = project_rock(self.world, self.view(camera), rock)
            margin = np.array([-1, -1, 1, 1]) * ROCK_MARGIN_PX * self.scale(camera)
            self._projections[camera, rock] = (
                ProjectedRock(clip(projection.box + margin, *self.view(camera).size), projection.visible_share)
                if projection
                else None
            )
        return self._projections[camera, rock]

    def px_per_m(self, camera: CameraSide, rock: int) -> float:
        """Return the scale of the image at a rock, px per metre."""
        view, body = self.view(camera), self.world.bodies.get(rock)
        centre = body.centre if body is not None else np.zeros(3)
        return view.lens.fx / float(np.linalg.norm(centre - view.centre))

    def fused(self, camera: CameraSide, azimuth: Azimuth | None = None) -> np.ndarray:
        """Return the weighted mean (tracks, 4) of the annotated boxes of each track and the projected mesh.

        Annotations under the same lamp have a higher weight because the visibility of edges depends on the light.
        """
        name = camera, azimuth if azimuth in self.azimuths else None
        if name not in self._fused_boxes:
            total, weight = np.zeros((len(self.tracks), 4)), np.zeros((len(self.tracks), 4))
            mesh_boxes = [self._mesh_box(camera, int(rock)) for rock in self.ids]
            for source in sorted({side for side, _ in self.annotated}):
                rows, count, boxes = self._annotated_means(source, name[1])
                moved = self._moved(boxes, self.ids[rows], source, camera)
                # Edges cut by the border of the source photo are ignored if a mesh determines them.
                has_mesh = np.array([mesh_boxes[row] is not None for row in rows], bool)[:, None]
                cut = self._cut(boxes, self.ids[rows], source) & has_mesh & (source != camera)
                total[rows] += count * ~cut * moved
                weight[rows] += count * ~cut
            meshed = np.flatnonzero([box is not None for box in mesh_boxes])
            mesh = np.array([mesh_boxes[row] for row in meshed]).reshape(-1, 4)
            count, annotated = weight[meshed], total[meshed] / np.maximum(weight[meshed], 1)
            mesh_weight = mesh_weights(annotated, count, mesh, MESH_WEIGHT, self.scale(camera))
            total[meshed] += mesh_weight * mesh
            weight[meshed] += mesh_weight
            self._fused_boxes[name] = total / weight
        return self._fused_boxes[name]

    def _annotated_means(
        self, camera: CameraSide, azimuth: Azimuth | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the annotated tracks (n,) of a camera, their weights (n, 1), and their mean boxes (n, 4)."""
        rows, weights, boxes = [], [], []
        for row, track in enumerate(self.tracks):
            drawings = [drawing for drawing in track.rows if drawing[0] == camera]
            if drawings:
                lamp_weights = [SAME_LAMP_WEIGHT if drawing[1] == azimuth else 1.0 for drawing in drawings]
                annotated = [self.annotated[drawing].rocks[track.rows[drawing]] for drawing in drawings]
                rows.append(row)
                weights.append(sum(lamp_weights))
                boxes.append(np.average(annotated, axis=0, weights=lamp_weights))
        return np.array(rows, int), np.array(weights)[:, None], np.array(boxes).reshape(-1, 4)

    def _cut(self, boxes: np.ndarray, rocks: np.ndarray, camera: CameraSide) -> np.ndarray:
        """Return a mask (n, 4) of edges cut by the border of a photo, in boxes (n, 4) or in projected meshes."""
        meshes = [self._mesh_box(camera, int(rock)) for rock in rocks]
        visible = np.array([box if mesh is None else mesh for box, mesh in zip(boxes, meshes, strict=True)])
        size = self.view(camera).size
        return at_border(boxes, size) | at_border(visible.reshape(-1, 4), size)

    def _mesh_box(self, camera: CameraSide, rock: int) -> np.ndarray | None:
        """Return the projected box (4,) of the mesh of a rock; None if less than `MIN_VISIBLE_SHARE` is visible."""
        body = self.world.bodies.get(rock)
        projection = self.projected(camera, rock) if body is not None and body.meshed else None
        return projection.box if projection is not None and projection.visible_share >= MIN_VISIBLE_SHARE else None

    def _moved(self, boxes: np.ndarray, rocks: np.ndarray, source: CameraSide, target: CameraSide) -> np.ndarray:
        if source == target:
            return boxes
        return move_rocks(self.world, self.view(source), self.view(target), boxes, rocks)

    def _projected_rocks(self, camera: CameraSide) -> list[Label]:
        labels, width = [], self.view(camera).lens.width
        for rock in sorted(self.world.bodies):
            projection = self.projected(camera, rock)
            if projection is None or projection.visible_share < MIN_VISIBLE_SHARE:
                continue
            if np.sqrt(area(projection.box)) >= self.options.min_rock_side_px * photo_scale(width):
                labels.append(make_label(ROCK, rock, "projected", projection.box, width))
        return labels

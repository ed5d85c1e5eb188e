"""Seed boxes of a terrain, carried to every exposure, light, azimuth and camera of its grid."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import rigs, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.formats.scene import TerrainMesh, read_terrain
from polarsim.geometry.boxes import area, clip
from polarsim.labels.identity import dome_behind, match_boxes, number_domes
from polarsim.labels.options import LabelsOptions
from polarsim.labels.seeds import Drawn, Seeds, drawn_camera, read_seeds
from polarsim.labels.shadows import Ids, cast_shadows, lamp
from polarsim.labels.tracks import Track, find_tracks
from polarsim.labels.view import View, move_flat, move_rocks, project_rock
from polarsim.labels.world import World, build_world, with_domes
from polarsim.photo import BOX_CLASSES, CAMERAS, NO_ROCK, ROCK, SHADOW, Azimuth, Camera, Light, PhotoKey

log = logging.getLogger(__name__)

# How likely a person's box overlaps by IoU >= 0.5, measured on terrains 01, 03, 04, 08, 11 of the release.
SURE = {"seed": 1.0, "fused": 0.9, "projected": 0.7, "cast": 0.5}


@dataclass(frozen=True)
class Label:
    """One box (4,) of a photo, and where it comes from."""

    kind: str
    rock: int
    source: str
    confidence: float
    box: np.ndarray


@dataclass(frozen=True)
class Known:
    """All that is known of a terrain's rocks: bodies, and for each position the drawn tracks with their rock ids."""

    world: World
    placed: dict[str, rigs.PlacedRig]
    seeds: Seeds
    tracks: dict[str, list[Track]]  # by position, in the drawn camera
    rocks: dict[str, np.ndarray]  # (tracks,) rock ids


def gather(
    terrain: TerrainMesh, placed: dict[str, rigs.PlacedRig], seeds: Seeds, options: LabelsOptions
) -> Known:
    """Give every drawn rock its id: that of the mesh that projects there, or the number of a stand-in."""
    world = build_world(terrain, options.trim_mm / 1000)
    tracks: dict[str, list[Track]] = {}
    matched: dict[str, np.ndarray] = {}
    domes = []
    for position in sorted(placed):
        camera = drawn_camera(seeds, position)
        if camera is None:
            continue
        view = View(placed[position], camera)
        tracks[position] = find_tracks(
            {azimuth: drawn.rocks for azimuth, drawn in seeds[position, camera].items()}, options.same_rock_iou
        )
        drawn = np.array([track.mean for track in tracks[position]]).reshape(-1, 4)
        shown = {rock: found for rock in world.bodies if (found := project_rock(world, view, rock))}
        rows = match_boxes(drawn, np.array([found.box for found in shown.values()]).reshape(-1, 4), options.match_gate_px)
        matched[position] = np.where(rows >= 0, np.array([*shown, NO_ROCK])[rows], NO_ROCK)
        domes.append([dome_behind(world, view, box) for box in drawn[rows < 0]])
    numbers, stand_ins = number_domes(domes)
    for position, own in zip(tracks, numbers, strict=True):
        matched[position][matched[position] == NO_ROCK] = own
    return Known(with_domes(world, stand_ins), placed, seeds, tracks, matched)


class PositionLabels:
    """Labels of one position of the tripod, for any camera and lamp; every camera's rays are cast once."""

    def __init__(self, known: Known, position: str, options: LabelsOptions) -> None:
        self.world, self.options = known.world, options
        self.placed = known.placed[position]
        self.drawn_camera = drawn_camera(known.seeds, position)
        self.drawn: dict[Azimuth, Drawn] = (
            known.seeds[position, self.drawn_camera] if self.drawn_camera is not None else {}
        )
        self.tracks, self.ids = known.tracks.get(position, []), known.rocks.get(position, np.zeros(0, int))
        self._fused_boxes: dict[int, np.ndarray] = {}
        self._ids: dict[Camera, Ids] = {}
        self._cast: dict[tuple[Camera, Light, Azimuth], dict[int, np.ndarray]] = {}

    def labels(self, camera: Camera, light: Light, azimuth: Azimuth) -> list[Label]:
        """What the photos of a camera under a lamp show, longest exposure."""
        if lamp(self.world, self.view(camera), light, azimuth) is None:
            return []
        rocks = self._rocks(camera, azimuth)
        shadows = self._shadows(camera, light, azimuth, {label.rock for label in rocks})
        return [label for label in rocks + shadows if area(label.box) > 0]

    def view(self, camera: Camera) -> View:
        return View(self.placed, camera)

    def _rocks(self, camera: Camera, azimuth: Azimuth) -> list[Label]:
        if self.drawn_camera is None:
            return self._projected_rocks(camera)
        if azimuth in self.drawn and camera == self.drawn_camera:
            chosen = [row for row, track in enumerate(self.tracks) if azimuth in track.boxes]
            return [self._label(ROCK, self.ids[row], "seed", 1.0, self.tracks[row].boxes[azimuth]) for row in chosen]
        if azimuth in self.drawn:
            chosen = [row for row, track in enumerate(self.tracks) if azimuth in track.boxes]
            share = np.ones(len(self.tracks))
        else:
            share = np.array([len(track.boxes) for track in self.tracks]) / max(1, len(self.drawn))
            chosen = [row for row in range(len(self.tracks)) if share[row] >= self.options.presence]
        boxes = np.array([self._fused(row) for row in chosen]).reshape(-1, 4)
        ids = self.ids[chosen]
        if camera != self.drawn_camera:
            boxes = move_rocks(self.world, self.view(self.drawn_camera), self.view(camera), boxes, ids)
        return [
            self._label(ROCK, rock, "fused", float(share[row]), box)
            for row, rock, box in zip(chosen, ids, boxes, strict=True)
        ]

    def _fused(self, row: int) -> np.ndarray:
        """(4,) mean of a track's boxes and, with its weight, of the box of the rock's mesh in the drawn camera."""
        if row not in self._fused_boxes:
            assert self.drawn_camera is not None
            track, body = self.tracks[row], self.world.bodies.get(int(self.ids[row]))
            weight = self.options.mesh_weight if body is not None and body.meshed else 0.0
            shown = project_rock(self.world, self.view(self.drawn_camera), int(self.ids[row])) if weight else None
            count = len(track.boxes)
            self._fused_boxes[row] = (
                (count * track.mean + weight * shown.box) / (count + weight) if shown else track.mean
            )
        return self._fused_boxes[row]

    def _projected_rocks(self, camera: Camera) -> list[Label]:
        labels = []
        for rock in sorted(self.world.bodies):
            shown = project_rock(self.world, self.view(camera), rock)
            if shown and shown.seen >= self.options.min_seen and np.sqrt(area(shown.box)) >= self.options.min_rock_px:
                labels.append(self._label(ROCK, rock, "projected", 1.0, shown.box))
        return labels

    def _shadows(self, camera: Camera, light: Light, azimuth: Azimuth, rocks: set[int]) -> list[Label]:
        if azimuth in self.drawn and self.drawn_camera is not None:
            boxes = self.drawn[azimuth].shadows
            throwers = self._throwers(boxes, light, azimuth)
            source = "seed"
            if camera != self.drawn_camera:
                source = "fused"
                boxes = move_flat(self.world, self.view(self.drawn_camera), self.view(camera), boxes)
            return [
                self._label(SHADOW, rock, source, 1.0, box) for rock, box in zip(throwers, boxes, strict=True)
            ]
        return [
            self._label(SHADOW, rock, "cast", 1.0, box)
            for rock, box in sorted(self.cast(camera, light, azimuth).items())
            if rock in rocks and np.sqrt(area(box)) >= self.options.min_shadow_px
        ]

    def _throwers(self, boxes: np.ndarray, light: Light, azimuth: Azimuth) -> np.ndarray:
        """(n,) rock that throws each drawn shadow, by the shadows that the bodies cast."""
        assert self.drawn_camera is not None
        cast = self.cast(self.drawn_camera, light, azimuth)
        rows = match_boxes(boxes, np.array([*cast.values()]).reshape(-1, 4), 2 * self.options.match_gate_px, 0.1)
        return np.where(rows >= 0, np.array([*cast, NO_ROCK])[rows], NO_ROCK)

    def cast(self, camera: Camera, light: Light, azimuth: Azimuth) -> dict[int, np.ndarray]:
        """Boxes (4,) of the shadows that the bodies cast under a lamp."""
        view, step = self.view(camera), self.options.ray_step_px
        place = lamp(self.world, view, light, azimuth)
        assert place is not None
        light = "off" if azimuth != "no" else light  # a Sun lamp outshines the rover light
        if (camera, light, azimuth) not in self._cast:
            if camera not in self._ids:
                width, height = view.size
                rows, columns = np.arange(step / 2, height, step), np.arange(step / 2, width, step)
                self._ids[camera] = Ids(self.world, view, rows, columns)
            self._cast[camera, light, azimuth] = cast_shadows(self.world, self._ids[camera], place, step)
        return self._cast[camera, light, azimuth]

    def _label(self, kind: str, rock: int, source: str, share: float, box: np.ndarray) -> Label:
        box = box if source == "seed" else clip(box)
        return Label(kind, int(rock), source, round(SURE[source] * share, 3), box)


def at_exposure(labels: list[Label], key: PhotoKey, options: LabelsOptions) -> list[Label]:
    """The labels that a photo's exposure lets a person see: rocks from the start, shadows from their own start on."""
    if key.azimuth == "no":
        return labels if key.exposure_ms >= options.no_sun_start_ms else []
    dark = key.exposure_ms < options.shadow_start(key.terrain)
    return [label for label in labels if not (dark and label.kind == SHADOW)]


def propagate_labels(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    photos: Path,
    inventory: Path,
    seeds: Path,
    cameras: Path,
    meshes: Path,
    boxes: Path,
    table: Path,
    options: LabelsOptions,
) -> None:
    """Write `boxes`/KEY.txt for every key and the label table; photos without anything to see get an empty file."""
    known = gather(read_terrain(meshes, terrain), rigs.read_all_placed(cameras), read_seeds(seeds, terrain), options)
    positions: dict[str, PositionLabels] = {}
    cache: dict[tuple[str, Camera, Light, Azimuth], list[Label]] = {}
    rows: list[dict[str, object]] = []
    with writing_folder(boxes) as folder:
        for key in keys:
            if key.position not in known.placed:
                labels: list[Label] = []
            else:
                if key.position not in positions:
                    positions[key.position] = PositionLabels(known, key.position, options)
                view_and_lamp = (key.position, key.camera, key.light, key.azimuth)
                if view_and_lamp not in cache:
                    cache[view_and_lamp] = positions[key.position].labels(key.camera, key.light, key.azimuth)
                labels = at_exposure(cache[view_and_lamp], key, options)
            classes = np.array([BOX_CLASSES.index(label.kind) for label in labels], int)
            yolo.write_boxes(folder / f"{key}.txt", classes, np.array([label.box for label in labels]).reshape(-1, 4))
            for label in labels:
                rows.append(
                    {
                        **tables.key_columns(key),
                        "kind": label.kind,
                        "rock": label.rock,
                        "source": label.source,
                        "confidence": label.confidence,
                        **dict(zip(("x0", "y0", "x1", "y1"), (float(edge) for edge in label.box), strict=True)),
                    }
                )
    tables.write_parquet(table, tables.label_table(rows))

"""Seed boxes of a terrain, carried to every exposure, light, azimuth and camera of its grid."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import LabelError
from polarsim.formats import lamps, rigs, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.formats.inventory import read_inventory
from polarsim.formats.scene import TerrainMesh, read_terrain
from polarsim.geometry.boxes import area, clip
from polarsim.labels.identity import dome_behind, match_boxes, number_domes
from polarsim.labels.options import LabelsOptions
from polarsim.labels.seeds import Drawn, Seeds, drawn_camera, read_seeds
from polarsim.labels.shadows import Ids, lamp, shadow_box
from polarsim.labels.tracks import Track, find_tracks
from polarsim.labels.view import ProjectedRock, View, move_flat, move_rocks, project_rock
from polarsim.labels.world import World, build_world, with_domes
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, Azimuth, Camera, Light, PhotoKey

log = logging.getLogger(__name__)

# How likely a person's box overlaps by IoU >= 0.5, measured on terrains 01, 03, 04, 08, 11 of the release.
SURE = {"seed": 1.0, "fused": 0.9, "projected": 0.7, "cast": 0.5}
SHADOW_GATE = 2.0  # shadows are long: they are matched within this many times the gate of rocks


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
    terrain: TerrainMesh,
    placed: dict[str, rigs.PlacedRig],
    suns: Mapping[str, np.ndarray],
    seeds: Seeds,
    options: LabelsOptions,
) -> Known:
    """Give every drawn rock its id: that of the mesh that projects there, or the number of a stand-in."""
    world = build_world(terrain, options.trim_mm / 1000, suns)
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
        rows = match_boxes(
            drawn, np.array([found.box for found in shown.values()]).reshape(-1, 4), options.match_gate_px
        )
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
        self._seen: dict[Camera, Ids] = {}
        self._shadow_ids: dict[tuple[Camera, bytes], np.ndarray] = {}

    def labels(self, camera: Camera, light: Light, azimuth: Azimuth) -> list[Label]:
        """What the photos of a camera under a lamp show, longest exposure."""
        if lamp(self.world, self.view(camera), light, azimuth) is None:
            return []
        rocks = self._rocks(camera, azimuth)
        shadows = self._shadows(camera, light, azimuth, rocks)
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
            shown = self._projected(self.drawn_camera, int(self.ids[row])) if weight else None
            count = len(track.boxes)
            self._fused_boxes[row] = (
                (count * track.mean + weight * shown.box) / (count + weight) if shown else track.mean
            )
        return self._fused_boxes[row]

    def _projected(self, camera: Camera, rock: int) -> ProjectedRock | None:
        """A body as a person would draw it."""
        shown = project_rock(self.world, self.view(camera), rock)
        margin = np.array([-1, -1, 1, 1]) * self.options.rock_margin_px
        return ProjectedRock(clip(shown.box + margin, *self.view(camera).size), shown.seen) if shown else None

    def _projected_rocks(self, camera: Camera) -> list[Label]:
        labels = []
        for rock in sorted(self.world.bodies):
            shown = self._projected(camera, rock)
            if shown and shown.seen >= self.options.min_seen and np.sqrt(area(shown.box)) >= self.options.min_rock_px:
                labels.append(self._label(ROCK, rock, "projected", 1.0, shown.box))
        return labels

    def _shadows(self, camera: Camera, light: Light, azimuth: Azimuth, rocks: list[Label]) -> list[Label]:
        if azimuth not in self.drawn or self.drawn_camera is None:
            cast = self._cast(camera, light, azimuth, {label.rock: label.box for label in rocks})
            least = self.options.min_rover_shadow_px if azimuth == "no" else self.options.min_shadow_px
            return [self._label(SHADOW, rock, "cast", 1.0, box) for rock, box in cast if np.sqrt(area(box)) >= least]
        boxes = self.drawn[azimuth].shadows
        throwers = self._throwers(boxes, light, azimuth)
        if camera == self.drawn_camera:
            return [self._label(SHADOW, rock, "seed", 1.0, box) for rock, box in zip(throwers, boxes, strict=True)]
        boxes = move_flat(self.world, self.view(self.drawn_camera), self.view(camera), boxes)
        return [self._label(SHADOW, rock, "fused", 1.0, box) for rock, box in zip(throwers, boxes, strict=True)]

    def _throwers(self, boxes: np.ndarray, light: Light, azimuth: Azimuth) -> np.ndarray:
        """(n,) rock that throws each drawn shadow, by the shadows that the bodies cast."""
        assert self.drawn_camera is not None
        cast = self._cast(self.drawn_camera, light, azimuth, dict.fromkeys(self.world.bodies))
        expected = np.array([box for _, box in cast]).reshape(-1, 4)
        rows = match_boxes(boxes, expected, SHADOW_GATE * self.options.match_gate_px, smallest_iou=0.1)
        return np.where(rows >= 0, np.array([*(rock for rock, _ in cast), NO_ROCK])[rows], NO_ROCK)

    def _cast(
        self, camera: Camera, light: Light, azimuth: Azimuth, rock_boxes: Mapping[int, np.ndarray | None]
    ) -> list[tuple[int, np.ndarray]]:
        """Boxes (4,) that a person would draw around the shadows of rocks, whose own boxes are given."""
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
        margin = np.array([-1, -1, 1, 1]) * self.options.shadow_margin_px
        found = [(rock, shadow_box(shadow, rock, box, step)) for rock, box in sorted(rock_boxes.items())]
        return [(rock, box + margin) for rock, box in found if box is not None]

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
    """Write `boxes`/KEY.txt for every key and the label table; photos with nothing to see get an empty file.

    Raises
    ------
    LabelError
        The inventory is another terrain's.
    FormatError
        A broken seed, camera or mesh file.
    """
    if (found := read_inventory(inventory).terrain) != terrain:
        raise LabelError(f"{inventory}: inventory of terrain {found:02d}, expected {terrain:02d}")
    _warn_of_gaps(photos, keys)
    placed = rigs.read_all_placed(cameras)
    suns = lamps.read_suns(cameras, placed)
    known = gather(read_terrain(meshes, terrain), placed, suns, read_seeds(seeds, terrain), options)
    labels = grid_labels(known, keys, options)
    with writing_folder(boxes) as folder:
        for key in keys:
            classes = np.array([BOX_CLASSES.index(label.kind) for label in labels[key]], int)
            drawn = np.array([label.box for label in labels[key]]).reshape(-1, 4)
            yolo.write_boxes(folder / f"{key}.txt", classes, drawn)
    tables.write_parquet(table, tables.label_table([_row(key, label) for key in keys for label in labels[key]]))


def grid_labels(known: Known, keys: Sequence[PhotoKey], options: LabelsOptions) -> dict[PhotoKey, list[Label]]:
    """Labels of every key; what photos share is computed once."""
    positions = {position: PositionLabels(known, position, options) for position in known.placed}
    for position in sorted({key.position for key in keys} - set(positions)):
        log.warning("position %s: no camera pose, its photos get no labels", position)
    sets: dict[tuple[str, Camera, Light, Azimuth], list[Label]] = {}
    labels: dict[PhotoKey, list[Label]] = {}
    for key in keys:
        if key.position not in positions:
            labels[key] = []
            continue
        photo_set = (key.position, key.camera, key.light, key.azimuth)
        if photo_set not in sets:
            sets[photo_set] = positions[key.position].labels(key.camera, key.light, key.azimuth)
        labels[key] = at_exposure(sets[photo_set], key, options)
    return labels


def _warn_of_gaps(photos: Path, keys: Sequence[PhotoKey]) -> None:
    """A source without any photo is no gap: labels alone are wanted."""
    there = set(tables.read_parquet(photos, ["key"])["key"])
    missing = [str(key) for key in keys if str(key) not in there]
    if there and missing:
        log.warning("%d of %d photos are missing, labelled all the same: %s ...", len(missing), len(keys), missing[0])


def _row(key: PhotoKey, label: Label) -> dict[str, object]:
    edges = dict(zip(("x0", "y0", "x1", "y1"), (float(edge) for edge in label.box), strict=True))
    named = {"kind": label.kind, "rock": label.rock, "source": label.source, "confidence": label.confidence}
    return {**tables.key_columns(key), **named, **edges}

"""Association of annotated boxes with rocks: boxes of the same rock form a track, and each track gets a rock id.

1. `find_tracks` groups the boxes of a position. The rig does not move, so overlapping boxes show the same rock.
2. `match_by_distance` matches tracks with projected meshes.
3. `fit_dome` and `number_domes` add numbered domes (half ellipsoids) for tracks without a mesh.
4. `associate_rocks` runs these steps for a terrain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from polarsim.geometry.boxes import iou, match_by_distance, match_by_iou, match_gate_px, match_pairs
from polarsim.geometry.camera import Camera
from polarsim.labels.bodies import Dome, TerrainCasters, build_worlds, with_domes
from polarsim.labels.projection import ground_depth, move_rocks, project_rock
from polarsim.labels.seeds import AnnotatedBoxes, AnnotationKey, Seeds, sort_by_camera
from polarsim.photo import FIRST_ID_WITHOUT_MESH, NO_ROCK, Azimuth, CameraSide
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.site_parts import RigLamp

SAME_ROCK_IOU = 0.3  # minimum IoU of boxes of the same rock in two azimuths
SAME_DOME_M = 0.06  # metres: two domes closer than this, or than the larger radius, are the same rock


@dataclass(frozen=True)
class Track:
    """Boxes of one rock in the annotations of a position: box index per annotation, and boxes (4,) in a common view."""

    rows: dict[AnnotationKey, int]
    boxes: dict[AnnotationKey, np.ndarray]

    @property
    def mean(self) -> np.ndarray:
        """Mean box (4,). Errors of edges are nearly independent, so the mean is more accurate than the median."""
        return np.mean(list(self.boxes.values()), axis=0)

    @property
    def azimuths(self) -> set[Azimuth]:
        return {azimuth for _, azimuth in self.rows}


def find_tracks(annotated: Mapping[AnnotationKey, np.ndarray], same_rock_iou: float = SAME_ROCK_IOU) -> list[Track]:
    """Group rock boxes (n, 4) of several annotations in a common view; a track has at most one box per annotation.

    Annotations are processed in descending order of their number of boxes.
    """
    tracks: list[Track] = []
    for drawing in sorted(annotated, key=lambda name: (-len(annotated[name]), name)):
        boxes = annotated[drawing]
        means = np.array([track.mean for track in tracks]).reshape(-1, 4)
        rows, columns = match_by_iou(iou(means, boxes), same_rock_iou)
        for row, column in zip(rows, columns, strict=True):
            tracks[row].rows[drawing] = int(column)
            tracks[row].boxes[drawing] = boxes[column]
        new = [column for column in range(len(boxes)) if column not in columns]
        tracks += [Track({drawing: column}, {drawing: boxes[column]}) for column in new]
    return tracks


def match_ids(
    boxes: np.ndarray, expected: np.ndarray, ids: Sequence[int], gate_px: float, smallest_iou: float = 0.2
) -> np.ndarray:
    """Return the id (n,) of the expected box (m, 4) that `match_by_distance` pairs with each box (n, 4), or NO_ROCK."""
    matched = np.full(len(boxes), NO_ROCK)
    rows, columns = match_by_distance(boxes, expected, gate_px, smallest_iou)
    matched[rows] = np.array(ids, int)[columns]
    return matched


def fit_dome(world: TerrainCasters, view: Camera, box: np.ndarray) -> Dome | None:
    """Return the dome whose outline fills a box (4,); None if the bottom of the box is above the horizon.

    For a camera pitched down by p, the outline of a dome of radius a and height h has the angular height of
    a sin p + sqrt((h cos p)^2 + (a sin p)^2).
    """
    foot = np.array([[(box[0] + box[2]) / 2, box[3]]])
    depth = float(ground_depth(world, view, foot)[0])
    if not np.isfinite(depth):
        return None
    direction = view.directions(foot)[0]
    unit = direction / np.linalg.norm(direction)
    metres_per_px = depth * np.linalg.norm(direction) / view.lens.fx
    radius = (box[2] - box[0]) / 2 * metres_per_px
    span = (box[3] - box[1]) * metres_per_px
    down, level = -unit[2], float(np.hypot(unit[0], unit[1]))
    height = np.sqrt(max(0.0, span**2 - 2 * span * radius * down)) / max(level, 0.2)
    ahead = np.array([unit[0], unit[1], 0]) / max(level, 1e-9)
    centre = view.centre + depth * direction + radius * ahead
    return Dome(centre, float(radius), float(np.clip(height, 0.4 * radius, 2.5 * radius)))


def number_domes(
    domes_of_views: list[list[Dome | None]], first: int = FIRST_ID_WITHOUT_MESH
) -> tuple[list[list[int]], dict[int, Dome]]:
    """Number rocks without a mesh: domes of different views at the same position are the same rock.

    Return the number of each dome of each view, from `first` upwards in the order of the input (None gets a unique
    number), and the mean dome of each number.
    """
    members: dict[int, list[Dome]] = {}
    numbers: list[list[int]] = []
    next_number = first
    for domes in domes_of_views:
        candidates = sorted(number for number, same_rock in members.items() if same_rock)
        distance = np.array([[_distance(dome, members[number]) for number in candidates] for dome in domes])
        distance = distance.reshape(len(domes), len(candidates))
        rows, columns = match_pairs(-distance, np.isfinite(distance))
        matched = {int(row): candidates[column] for row, column in zip(rows, columns, strict=True)}
        view_numbers = []
        for row, dome in enumerate(domes):
            number = matched.get(row, next_number)
            next_number += row not in matched
            members.setdefault(number, [])
            if dome is not None:
                members[number].append(dome)
            view_numbers.append(number)
        numbers.append(view_numbers)
    return numbers, {number: _mean_dome(same_rock) for number, same_rock in members.items() if same_rock}


def _distance(dome: Dome | None, members: list[Dome]) -> float:
    """Return the distance of a dome to the mean of domes of one rock, metres; inf if too far to be the same rock."""
    if dome is None:
        return np.inf
    mean = _mean_dome(members)
    distance = float(np.linalg.norm(dome.foot[:2] - mean.foot[:2]))
    return distance if distance < max(SAME_DOME_M, dome.radius, mean.radius) else np.inf


def _mean_dome(domes: list[Dome]) -> Dome:
    return Dome(
        np.mean([dome.foot for dome in domes], axis=0),
        float(np.mean([dome.radius for dome in domes])),
        float(np.mean([dome.height for dome in domes])),
    )


@dataclass(frozen=True)
class TerrainRocks:
    """Rocks of a terrain as bodies, and for each position the annotated tracks with rock ids."""

    terrain: TerrainMesh
    domes: dict[int, Dome]  # for rocks without a mesh
    world: TerrainCasters  # of meshes and domes
    localised: dict[str, LocalisedRig]
    seeds: Seeds
    tracks: dict[str, list[Track]]
    rocks: dict[str, np.ndarray]  # by position: (tracks,) rock ids
    unverified: Mapping[str, TerrainRocks] = field(default_factory=dict)  # positions with unverified poses, separated

    def of(self, position: str) -> TerrainRocks:
        """Return the rocks for a position; only from the annotations of the position if its pose is unverified."""
        return self.unverified.get(position, self)


def associate_rocks(
    terrain: TerrainMesh,
    localised: dict[str, LocalisedRig],
    suns: Mapping[str, np.ndarray],
    rig_lamp: RigLamp | None,
    seeds: Seeds,
) -> TerrainRocks:
    """Assign an id to every annotated rock: the id of the projected mesh, or the number of a dome.

    With an unverified pose, meshes project onto wrong rocks. The rocks of such a position are domes on the bare
    ground behind the boxes of the position, and are not used at other positions.
    """
    world, bare = build_worlds(terrain, localised, suns, rig_lamp)
    located = {position: rig for position, rig in localised.items() if not rig.unproven}
    terrain_rocks = _gathered(terrain, world, located, seeds, FIRST_ID_WITHOUT_MESH)
    separate: dict[str, TerrainRocks] = {}
    if len(located) < len(localised):
        ground = terrain.ground()
        next_number = (
            max([FIRST_ID_WITHOUT_MESH - 1, *(int(rock) for ids in terrain_rocks.rocks.values() for rock in ids)]) + 1
        )
        for position in sorted(set(localised) - set(located)):
            separate[position] = _gathered(ground, bare, {position: localised[position]}, seeds, next_number)
            next_number += len(separate[position].rocks.get(position, ()))
    return replace(terrain_rocks, localised=localised, unverified=separate)


def _gathered(
    terrain: TerrainMesh, world: TerrainCasters, localised: dict[str, LocalisedRig], seeds: Seeds, first: int
) -> TerrainRocks:
    """Associate the boxes of positions with consistent poses; domes are numbered from `first`."""
    tracks: dict[str, list[Track]] = {}
    matched: dict[str, np.ndarray] = {}
    domes = []
    for position in sorted(set(localised) & set(seeds)):
        side = sort_by_camera(list(seeds[position]))[0][0]
        view = localised[position].camera(side)
        boxes = _in_one_camera(world, localised[position], side, seeds[position])
        tracks[position] = find_tracks(boxes)
        annotated = np.array([track.mean for track in tracks[position]]).reshape(-1, 4)
        projected = {rock: shape for rock in world.bodies if (shape := project_rock(world, view, rock))}
        expected = np.array([shape.box for shape in projected.values()]).reshape(-1, 4)
        matched[position] = match_ids(annotated, expected, list(projected), match_gate_px(view.lens.width))
        domes.append([fit_dome(world, view, box) for box in annotated[matched[position] == NO_ROCK]])
    numbers, stand_ins = number_domes(domes, first)
    for position, stand_in_ids in zip(tracks, numbers, strict=True):
        matched[position][matched[position] == NO_ROCK] = stand_in_ids
    return TerrainRocks(terrain, stand_ins, with_domes(world, stand_ins), localised, seeds, tracks, matched)


def _in_one_camera(
    world: TerrainCasters, localised: LocalisedRig, side: CameraSide, drawings: Mapping[AnnotationKey, AnnotatedBoxes]
) -> dict[AnnotationKey, np.ndarray]:
    """Return rock boxes (n, 4) of both cameras in the image of one camera, shifted like the ground below the boxes."""
    moved = {}
    for (camera, azimuth), annotated in drawings.items():
        boxes, no_ids = annotated.rocks, np.full(len(annotated.rocks), NO_ROCK)
        if camera != side:
            boxes = move_rocks(world, localised.camera(camera), localised.camera(side), boxes, no_ids)
        moved[camera, azimuth] = boxes
    return moved

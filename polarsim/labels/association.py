"""Association of annotated boxes with rocks: boxes of one rock form a track, and a track gets the id of a rock.

1. `find_tracks` groups the boxes of a position. The rig stands still, so boxes that overlap are the same rock.
2. `match_nearest` pairs tracks with the meshes that project there.
3. `dome_behind` and `number_domes` put numbered stand-ins where no mesh projects.
4. `gather` runs these steps for a terrain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from polarsim.geometry.boxes import MATCH_GATE_PX, iou, match, match_nearest, pairs
from polarsim.geometry.camera import Camera
from polarsim.labels.bodies import Dome, World, build_worlds, with_domes
from polarsim.labels.projection import ground_depth, move_rocks, project_rock
from polarsim.labels.seeds import Annotated, DrawingKey, Seeds, cameras_first
from polarsim.photo import FIRST_UNMESHED_ROCK, NO_ROCK, Azimuth, CameraSide
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh

SAME_ROCK_IOU = 0.3  # boxes of two azimuths that overlap this much are the same rock
SAME_POSITION = 0.06  # metres: two stand-ins nearer than this, or than half a radius, are one rock


@dataclass(frozen=True)
class Track:
    """A rock in the drawings of a position: the number of its box in each, and its boxes (4,) in one common view."""

    rows: dict[DrawingKey, int]
    boxes: dict[DrawingKey, np.ndarray]

    @property
    def mean(self) -> np.ndarray:
        """(4,) mean of every edge: errors of edges are nearly independent, and the mean beats the median."""
        return np.mean(list(self.boxes.values()), axis=0)

    @property
    def azimuths(self) -> set[Azimuth]:
        return {azimuth for _, azimuth in self.rows}


def find_tracks(annotated: Mapping[DrawingKey, np.ndarray], same_rock_iou: float = SAME_ROCK_IOU) -> list[Track]:
    """Group rock boxes (n, 4) of several drawings, all moved into one view; one box a drawing at most.

    Drawings join in the order of their number of boxes, most first, so that the fullest one sets the pattern.
    """
    tracks: list[Track] = []
    for drawing in sorted(annotated, key=lambda name: (-len(annotated[name]), name)):
        boxes = annotated[drawing]
        means = np.array([track.mean for track in tracks]).reshape(-1, 4)
        rows, columns = match(iou(means, boxes), same_rock_iou)
        for row, column in zip(rows, columns, strict=True):
            tracks[row].rows[drawing] = int(column)
            tracks[row].boxes[drawing] = boxes[column]
        new = [column for column in range(len(boxes)) if column not in columns]
        tracks += [Track({drawing: column}, {drawing: boxes[column]}) for column in new]
    return tracks


def match_ids(
    boxes: np.ndarray, expected: np.ndarray, ids: Sequence[int], gate_px: float, smallest_iou: float = 0.2
) -> np.ndarray:
    """Return the id (n,) of the expected box (m, 4) that `match_nearest` pairs with each box (n, 4); else NO_ROCK."""
    found = np.full(len(boxes), NO_ROCK)
    rows, columns = match_nearest(boxes, expected, gate_px, smallest_iou)
    found[rows] = np.array(ids, int)[columns]
    return found


def dome_behind(world: World, view: Camera, box: np.ndarray) -> Dome | None:
    """The dome whose outline a box (4,) frames; None where the box's foot is not on the ground.

    From a camera that looks down by p, a dome of radius a and height h spans a sin p + sqrt((h cos p)^2 + (a sin p)^2).
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
    domes_of_views: list[list[Dome | None]], first: int = FIRST_UNMESHED_ROCK
) -> tuple[list[list[int]], dict[int, Dome]]:
    """Give unmeshed rocks their numbers: domes of different views that stand at one position are one rock.

    Returns the number of each dome (`first` and on, in the order of views and of domes within; a box that gave no dome
    gets a number of its own too), and the mean dome of each number.
    """
    members: dict[int, list[Dome]] = {}
    numbers: list[list[int]] = []
    following = first
    for domes in domes_of_views:
        known = sorted(number for number, stood in members.items() if stood)
        apart = np.array([[_apart(dome, members[number]) for number in known] for dome in domes])
        apart = apart.reshape(len(domes), len(known))
        rows, columns = pairs(-apart, np.isfinite(apart))
        taken = {int(row): known[column] for row, column in zip(rows, columns, strict=True)}
        own = []
        for row, dome in enumerate(domes):
            number = taken.get(row, following)
            following += row not in taken
            members.setdefault(number, [])
            if dome is not None:
                members[number].append(dome)
            own.append(number)
        numbers.append(own)
    return numbers, {number: _mean_dome(stood) for number, stood in members.items() if stood}


def _apart(dome: Dome | None, others: list[Dome]) -> float:
    if dome is None:
        return np.inf
    other = _mean_dome(others)
    distance = float(np.linalg.norm(dome.foot[:2] - other.foot[:2]))
    return distance if distance < max(SAME_POSITION, dome.radius, other.radius) else np.inf


def _mean_dome(domes: list[Dome]) -> Dome:
    return Dome(
        np.mean([dome.foot for dome in domes], axis=0),
        float(np.mean([dome.radius for dome in domes])),
        float(np.mean([dome.height for dome in domes])),
    )


@dataclass(frozen=True)
class Known:
    """A terrain's rocks as bodies, and for each position the annotated tracks with their rock ids."""

    terrain: TerrainMesh
    domes: dict[int, Dome]  # stand-ins of rocks without a mesh
    world: World  # of meshes and stand-ins
    localised: dict[str, LocalisedRig]
    seeds: Seeds
    tracks: dict[str, list[Track]]
    rocks: dict[str, np.ndarray]  # by position: (tracks,) rock ids
    apart: Mapping[str, Known] = field(default_factory=dict)  # positions of unproven pose, each by itself

    def of(self, position: str) -> Known:
        """What photos of a position may use: its own drawings alone where nobody knows where its cameras stood."""
        return self.apart.get(position, self)


def gather(
    terrain: TerrainMesh,
    localised: dict[str, LocalisedRig],
    suns: Mapping[str, np.ndarray],
    seeds: Seeds,
    wall_height: float,
) -> Known:
    """Give every annotated rock its id: that of the mesh that projects there, or the number of a stand-in.

    Meshes projected through an unproven pose meet other rocks. A position with such a pose keeps to its image: its
    rocks are stand-ins behind its own boxes on the bare ground, and no other position knows of them.
    """
    world, bare = build_worlds(terrain, localised, suns, wall_height)
    located = {position: rig for position, rig in localised.items() if not rig.unproven}
    known = _gathered(terrain, world, located, seeds, FIRST_UNMESHED_ROCK)
    apart: dict[str, Known] = {}
    if len(located) < len(localised):
        ground = terrain.ground()
        following = max([FIRST_UNMESHED_ROCK - 1, *(int(rock) for ids in known.rocks.values() for rock in ids)]) + 1
        for position in sorted(set(localised) - set(located)):
            apart[position] = _gathered(ground, bare, {position: localised[position]}, seeds, following)
            following += len(apart[position].rocks.get(position, ()))
    return replace(known, localised=localised, apart=apart)


def _gathered(
    terrain: TerrainMesh, world: World, localised: dict[str, LocalisedRig], seeds: Seeds, first: int
) -> Known:
    """What positions whose poses agree tell of the rocks of a world; stand-ins are numbered from `first`."""
    tracks: dict[str, list[Track]] = {}
    matched: dict[str, np.ndarray] = {}
    domes = []
    for position in sorted(set(localised) & set(seeds)):
        side = cameras_first(list(seeds[position]))[0][0]
        view = localised[position].camera(side)
        boxes = _in_one_camera(world, localised[position], side, seeds[position])
        tracks[position] = find_tracks(boxes)
        annotated = np.array([track.mean for track in tracks[position]]).reshape(-1, 4)
        shown = {rock: found for rock in world.bodies if (found := project_rock(world, view, rock))}
        expected = np.array([found.box for found in shown.values()]).reshape(-1, 4)
        matched[position] = match_ids(annotated, expected, list(shown), MATCH_GATE_PX)
        domes.append([dome_behind(world, view, box) for box in annotated[matched[position] == NO_ROCK]])
    numbers, stand_ins = number_domes(domes, first)
    for position, own in zip(tracks, numbers, strict=True):
        matched[position][matched[position] == NO_ROCK] = own
    return Known(terrain, stand_ins, with_domes(world, stand_ins), localised, seeds, tracks, matched)


def _in_one_camera(
    world: World, localised: LocalisedRig, side: CameraSide, drawings: Mapping[DrawingKey, Annotated]
) -> dict[DrawingKey, np.ndarray]:
    """Rock boxes (n, 4) of drawings of both cameras as one camera sees them, moved with the ground at their feet."""
    moved = {}
    for (own, azimuth), annotated in drawings.items():
        boxes, nameless = annotated.rocks, np.full(len(annotated.rocks), NO_ROCK)
        if own != side:
            boxes = move_rocks(world, localised.camera(own), localised.camera(side), boxes, nameless)
        moved[own, azimuth] = boxes
    return moved

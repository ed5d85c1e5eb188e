"""What is known of a terrain before its photos are labelled: bodies, poses, drawings, and which rock is which."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from polarsim.geometry.boxes import MATCH_GATE_PX
from polarsim.labels.bodies import Dome, World, build_worlds, with_domes
from polarsim.labels.identity import dome_behind, match_boxes, number_domes
from polarsim.labels.options import LabelsOptions
from polarsim.labels.projection import move_rocks, project_rock
from polarsim.labels.seeds import Annotated, DrawingKey, Seeds, cameras_first
from polarsim.labels.tracks import Track, find_tracks
from polarsim.photo import FIRST_UNMESHED_ROCK, NO_ROCK, CameraSide
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh


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
    options: LabelsOptions,
) -> Known:
    """Give every annotated rock its id: that of the mesh that projects there, or the number of a stand-in.

    Meshes projected through an unproven pose meet other rocks. A position with such a pose keeps to its image: its
    rocks are stand-ins behind its own boxes on the bare ground, and no other position knows of them.
    """
    world, bare = build_worlds(terrain, localised, suns, options)
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
        rows = match_boxes(annotated, np.array([found.box for found in shown.values()]).reshape(-1, 4), MATCH_GATE_PX)
        matched[position] = np.where(rows >= 0, np.array([*shown, NO_ROCK])[rows], NO_ROCK)
        domes.append([dome_behind(world, view, box) for box in annotated[rows < 0]])
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

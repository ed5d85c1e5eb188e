"""What people drew: seed labels and corrections, the only label files that propagation may read.

They also tell from which exposure on people see shadows under Sun lamps, and rocks without any lamp.
"""

from __future__ import annotations

import logging
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import yolo
from polarsim.formats.coco import read_coco
from polarsim.formats.release import read_annotated
from polarsim.geometry.boxes import iou, match
from polarsim.geometry.consensus import consensus_boxes, positions_of_strangers
from polarsim.labels.label import Label, label_of
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, SUNS, Azimuth, Bracket, CameraSide, Light, PhotoKey
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh

log = logging.getLogger(__name__)

DrawingKey = tuple[CameraSide, Azimuth]  # which drawing of a position, by its camera and lamp
Ranked = tuple[tuple[bool, bool, int], "Annotated"]  # a correction, light off, number of boxes: the highest wins
LEAST_VOTES = 3  # of exposure brackets that tell of another: one odd seed shall move nothing but its own photos
SAME_LABEL = 0.1  # least IoU of a person's box with a propagated one whose rock it takes over


@dataclass(frozen=True)
class ShadowStarts:
    """Shortest exposures with shadow labels: of exposure brackets that tell, and of all others."""

    usual_ms: int  # where nobody drew anything that tells
    annotated_ms: Mapping[Bracket, int] = field(default_factory=dict)

    def of(self, key: PhotoKey) -> int:
        """The start for a photo: its own exposure bracket's, else the median of its position, else of the terrain.

        On six terrains of the release, Left seeds alone, 45 of 1,956 photos under a Sun get shadows though people drew
        none, or the other way round; 53 with the median of position and azimuth, 143 with the terrain's shortest.
        """
        own = self.annotated_ms.get(key.bracket)
        if own is not None:
            return own
        here = [start for (_, position, *_), start in self.annotated_ms.items() if position == key.position]
        for votes in (here, list(self.annotated_ms.values())):
            if len(votes) >= LEAST_VOTES:
                return statistics.median_high(votes)
        return self.usual_ms


@dataclass(frozen=True)
class Annotated:
    """What a person drew in one photo: boxes (n, 4) in pixels. Shadows: None where the photo is too dark to tell."""

    rocks: np.ndarray
    shadows: np.ndarray | None

    @classmethod
    def of(cls, classes: np.ndarray, boxes: np.ndarray) -> Annotated:
        """Boxes (n, 4) shared out by their class numbers (n,)."""
        return cls(boxes[classes == BOX_CLASSES.index(ROCK)], boxes[classes == BOX_CLASSES.index(SHADOW)])


Drawings = Mapping[PhotoKey, Annotated]
Seeds = dict[str, dict[DrawingKey, Annotated]]  # by position


def read_drawings(folder: Path, terrain: int) -> Drawings:
    """Every `KEY.txt` of a terrain.

    Raises
    ------
    FormatError
        A broken label line.
    LabelError
        A file name that is no photo key.
    """
    found = {}
    for path in sorted(folder.glob("*.txt")):
        key = PhotoKey.parse(path.stem)
        if key.terrain != terrain:
            log.warning("%s: no seed of terrain %02d, left out", path, terrain)
            continue
        found[key] = Annotated.of(*yolo.read_boxes(path))
    return found


def shadow_starts(drawings: Drawings, usual_ms: int) -> ShadowStarts:
    """Where shadows begin under Sun lamps: at `usual_ms`, or where somebody drew some at a shorter exposure."""
    annotated_ms: dict[Bracket, int] = {}
    for key, annotated in drawings.items():
        if key.azimuth in SUNS and annotated.shadows is not None and len(annotated.shadows):
            annotated_ms[key.bracket] = min(annotated_ms.get(key.bracket, usual_ms), key.exposure_ms)
    return ShadowStarts(usual_ms, annotated_ms)


def choose_seeds(drawings: Drawings, corrections: Drawings, starts: ShadowStarts) -> Seeds:
    """One drawing a position, camera and azimuth.

    Parameters
    ----------
    corrections
        What people drew anew: it wins over seeds.
    starts
        Shortest exposures at which people draw shadows: what is shorter and has none says nothing about them, and
        another drawing of the same camera and lamp tells.
    """
    found: dict[tuple[str, DrawingKey], list[Ranked]] = {}
    both = [
        *((key, False, annotated) for key, annotated in drawings.items()),
        *((k, True, d) for k, d in corrections.items()),
    ]
    for key, is_correction, annotated in both:
        count = len(annotated.rocks) + (0 if annotated.shadows is None else len(annotated.shadows))
        rank = (is_correction, key.light == "off", count)
        silent = key.exposure_ms < starts.of(key) and (annotated.shadows is None or not len(annotated.shadows))
        seed = replace(annotated, shadows=None) if silent else annotated
        found.setdefault((key.position, (key.camera, key.azimuth)), []).append((rank, seed))
    seeds: Seeds = {}
    for (position, drawing), ranked in sorted(found.items(), key=lambda item: item[0]):
        seeds.setdefault(position, {})[drawing] = _best(ranked)
    return seeds


def cameras_first(drawings: Sequence[DrawingKey]) -> list[DrawingKey]:
    """Drawings of the camera that has most of them first; left before right where they are even."""
    count = {camera: sum(own == camera for own, _ in drawings) for camera, _ in drawings}
    return sorted(drawings, key=lambda drawing: (-count[drawing[0]], drawing))


def _best(ranked: list[Ranked]) -> Annotated:
    """The drawing that wins; its shadows, where it knows of none, from the next that does."""
    in_order = [annotated for _, annotated in sorted(ranked, key=lambda item: item[0], reverse=True)]
    shadows = next((annotated.shadows for annotated in in_order if annotated.shadows is not None), None)
    return replace(in_order[0], shadows=shadows)


def is_unlit(light: Light, azimuth: Azimuth) -> bool:
    """Neither a Sun lamp nor the rover light shines."""
    return azimuth == "no" and light == "off"


@dataclass(frozen=True)
class UnlitStarts:
    """Shortest exposure with rocks that people drew without any lamp, by position."""

    annotated_ms: Mapping[str, int]

    @classmethod
    def of(cls, drawings: Drawings) -> UnlitStarts:
        """Each position speaks for itself: a light leak at one does not reach the others."""
        annotated_ms: dict[str, int] = {}
        for key, annotated in drawings.items():
            if is_unlit(key.light, key.azimuth) and len(annotated.rocks):
                annotated_ms[key.position] = min(annotated_ms.get(key.position, key.exposure_ms), key.exposure_ms)
        return cls(annotated_ms)

    def shown(self, key: PhotoKey) -> bool:
        """Whether an unlit photo shows anything, as far as somebody drew it; nobody did: it is black."""
        start = self.annotated_ms.get(key.position)
        return start is not None and key.exposure_ms >= start


def without_strangers(drawings: Drawings, terrain: TerrainMesh, localised: Mapping[str, LocalisedRig]) -> Drawings:
    """The drawings of positions whose left photos' rocks the meshes meet; a warning names the others.

    Unproven poses tell nothing, and neither do they of their own position's drawings.
    """
    annotated: dict[str, list[np.ndarray]] = {}
    for key, one in drawings.items():
        if key.camera == "L":
            annotated.setdefault(key.position, []).append(one.rocks)
    agreed = {position: consensus_boxes(own) for position, own in annotated.items()}
    cameras = {position: rig.camera("L") for position, rig in localised.items() if not rig.unproven}
    names = positions_of_strangers(agreed, cameras, [terrain.rock_vertices(rock) for rock in terrain.rocks])
    return {key: one for key, one in drawings.items() if key.position not in names}


def read_corrections(folder: Path | None, terrain: int) -> dict[PhotoKey, Annotated]:
    """Return the corrected photos of a terrain, see `read_all_corrections`; none without a folder."""
    found = {} if folder is None else read_all_corrections(folder)
    return {key: annotated for key, annotated in found.items() if key.terrain == terrain}


def read_all_corrections(folder: Path) -> dict[PhotoKey, Annotated]:
    """Read the boxes that people corrected, by photo, from `KEY.txt` and COCO files (`*.json`).

    Raises
    ------
    FormatError
        No such folder, a broken file in it, or a photo that is corrected twice.
    """
    found = read_annotated(folder)
    for path in sorted(Path(folder).rglob("*.json")):
        for key, annotated in read_coco(path).items():
            if key in found:
                raise FormatError(f"{key} is corrected in another file of {folder} too", path=path)
            classes = np.array([BOX_CLASSES.index(one.kind) for one in annotated], int)
            found[key] = classes, np.array([one.box for one in annotated]).reshape(-1, 4)
    return {key: Annotated.of(*found[key]) for key in sorted(found)}


def as_annotated(annotated: Annotated, labels: Sequence[Label]) -> list[Label]:
    """The boxes of a person, with the rocks of the propagated labels of the same exposure bracket that they lie on."""
    found = []
    for kind, boxes in ((ROCK, annotated.rocks), (SHADOW, annotated.shadows)):
        if boxes is None:
            continue
        near = [label for label in labels if label.kind == kind]
        own = np.array([label.box for label in near]).reshape(-1, 4)
        rocks = matched_rocks(boxes, own, np.array([label.rock for label in near], int))
        found += [label_of(kind, rock, "seed", box) for rock, box in zip(rocks, boxes, strict=True)]
    return found


def matched_rocks(boxes: np.ndarray, labels: np.ndarray, rocks: np.ndarray) -> np.ndarray:
    """Return the rock (n,) of the label (m, 4) that each box (n, 4) is matched with, one to one; NO_ROCK without one.

    `rocks` (m,) are those of the labels.
    """
    rows, columns = match(iou(boxes, labels), SAME_LABEL)
    found = np.full(len(boxes), NO_ROCK)
    found[rows] = rocks[columns]
    return found

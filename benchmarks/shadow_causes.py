"""Why rendered and propagated-over shadow boxes differ from annotated ones: one component replaced at a time, and
ceilings.

`python benchmarks/shadow_causes.py RELEASE WORK [--config config/release.yaml] [--terrains 1 3 4 8 11 12]`

RELEASE and WORK are those of `benchmarks/transfers.py`, whose localised runs below WORK are taken up. The first table
has shadows as a renderer makes them (ground that a rock hides from the lamp), against the fullest annotated file of
each exposure bracket under a Sun lamp, rover light off, both cameras. The second has the Left drawing's shadows in the
Right photos, every published file, with what nobody can know replaced by what the Right drawing says.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy import ndimage
from transfers import Run, Truth, read_truth

from polarsim.config import read_config
from polarsim.geometry.boxes import area, centres, clip, iou, match_sum, of_mask
from polarsim.geometry.camera import Camera
from polarsim.geometry.outlines import TRIM
from polarsim.geometry.polygons import without_thin_parts
from polarsim.labels.association import Known, gather
from polarsim.labels.bodies import World, build_world
from polarsim.labels.casting import Ids, sightlines
from polarsim.labels.options import LabelsOptions
from polarsim.labels.parts import windows_of
from polarsim.labels.projection import move_flat
from polarsim.labels.propagate import PositionLabels
from polarsim.labels.seeds import ShadowStarts, choose_seeds, read_drawings, shadow_starts
from polarsim.labels.shadows import PositionShadows
from polarsim.labels.wall_shade import passing_heights
from polarsim.photo import NO_ROCK, ROCK, SHADOW, SUNS, Azimuth, CameraSide, PhotoKey
from polarsim.run_files import lamps, rigs
from polarsim.run_files.scene import read_terrain
from polarsim.scoring.score import Counts, count_boxes

STEP = 2  # px between the rays
LEAST_PX, LEAST_PART_PX, WIDTH_PX = 60, 20, 3  # of rendered shadows, as `render` has them
DISC_M, DISC_RAYS = 0.05, 12
WALL_M = LabelsOptions().wall_height_m

Boxes = dict[int, np.ndarray]  # rock -> (4,)


class Seen:
    """What a camera sees at every `STEP`-th pixel: ground, rocks, and where rays meet the rocks."""

    def __init__(self, world: World, view: Camera) -> None:
        width, height = view.size
        rows, columns = np.arange(STEP / 2, height, STEP), np.arange(STEP / 2, width, STEP)
        self.world, self.view, self.ids = world, view, Ids(world, view, rows, columns)
        rays = sightlines(world, view, rows, columns)
        self.on_rock = self.ids.rock != NO_ROCK
        met = self.on_rock.ravel()
        self.rock_points = view.centre + rays.distance[met, None] * rays.directions[met]

    def shaded(self, points: np.ndarray, lamp: np.ndarray) -> np.ndarray:
        """(n,) the rock that hides a lamp from points (n, 3)."""
        distance, face = self.world.rocks.nearest(points, lamp - points)
        return np.where(distance < 1, self.world.rock_of_rocks_face[face], NO_ROCK)

    def shadows(self, lamp: np.ndarray, *, lifted: float = 0.0, walls: float = WALL_M) -> np.ndarray:
        """(rows, columns) whose shadow is seen on the ground, that lies `lifted` metres higher than its mesh."""
        picture = np.full(self.ids.shape, NO_ROCK)
        bare = self.ids.rock[self.ids.ground] == NO_ROCK
        points = self.ids.points[bare]
        sight = points - self.view.centre
        points = points + lifted / sight[:, 2:] * sight
        rock = self.shaded(points, lamp)
        if walls:
            passing = passing_heights(points, lamp, self.world.ground_bounds)
            rock[passing < self.world.ground_level + walls] = NO_ROCK
        picture[self.ids.ground & (self.ids.rock == NO_ROCK)] = rock
        return picture

    def disc_shadows(self, lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Under a lamp that is a disc facing the sandbox: whose shadow, and the share of the disc that is hidden."""
        towards = lamp / np.linalg.norm(lamp)
        across = np.cross(towards, [0, 0, 1.0])
        across /= np.linalg.norm(across)
        upward = np.cross(across, towards)
        number = np.arange(DISC_RAYS)
        radius, angle = DISC_M * np.sqrt((number + 0.5) / DISC_RAYS), number * np.pi * (3 - 5**0.5)
        offsets = radius * (np.cos(angle) * across[:, None] + np.sin(angle) * upward[:, None])
        pictures = np.stack([self.shadows(lamp + offset) for offset in offsets.T])
        return pictures.max(axis=0), (pictures != NO_ROCK).mean(axis=0)  # NO_ROCK is the lowest number

    def with_rocks(self, picture: np.ndarray, lamp: np.ndarray, *, own: bool) -> np.ndarray:
        """Shadows on rocks added: each rock's on itself, or those on others."""
        to_lamp = lamp - self.rock_points
        starts = self.rock_points + 0.004 * to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
        thrower = self.shaded(starts, lamp)
        counts = (thrower == self.ids.rock[self.on_rock]) == own
        found = picture.copy()
        found[self.on_rock] = np.where(counts, thrower, NO_ROCK)
        return found


def boxes_of(picture: np.ndarray, width_px: int = WIDTH_PX) -> Boxes:
    """Boxes around shadows as a renderer's labels have them."""
    found: Boxes = {}
    for rock, window in windows_of(picture).items():
        mask = without_thin_parts(picture[window] == rock, round(width_px / STEP))
        parts, _ = ndimage.label(mask, np.ones((3, 3), bool))
        sizes = np.bincount(parts.ravel()) * STEP**2
        sizes[0] = 0
        large = sizes >= LEAST_PART_PX
        box = of_mask(large[parts])
        if box is not None and sizes[large].sum() >= LEAST_PX:
            found[rock] = (box + np.tile([window[1].start, window[0].start], 2)) * STEP
    return found


def touching(picture: np.ndarray) -> np.ndarray:
    """Shadows that touch as one."""
    parts, _ = ndimage.label(picture != NO_ROCK, np.ones((3, 3), bool))
    return np.where(parts > 0, parts, NO_ROCK)


def causes(
    seen: Seen, lamp: np.ndarray, labels: Boxes, shadows: PositionShadows, drawing: tuple[CameraSide, Azimuth]
) -> Iterator[tuple[str, Boxes]]:
    """(name, boxes) of every component."""
    camera, azimuth = drawing
    plain = seen.shadows(lamp)
    rendered = boxes_of(plain)
    yield "rendered", rendered
    yield "thin parts count", boxes_of(plain, 1)
    yield "ground 10 mm lower", boxes_of(seen.shadows(lamp, lifted=-0.01))
    yield "ground 10 mm higher", boxes_of(seen.shadows(lamp, lifted=0.01))
    thrower, hidden = seen.disc_shadows(lamp)
    for least in (0.1, 0.5, 0.9):
        yield f"disc of 5 cm, {least:.0%} hidden", boxes_of(np.where(hidden >= least, thrower, NO_ROCK))
    yield "on other rocks too", boxes_of(seen.with_rocks(plain, lamp, own=False))
    yield "own dark side too", boxes_of(seen.with_rocks(plain, lamp, own=True))
    yield "touching ones as one", boxes_of(touching(plain))
    yield "walls shade nothing", boxes_of(seen.shadows(lamp, walls=0.0))
    yield "labelled rocks alone", {rock: box for rock, box in rendered.items() if rock in labels}
    cast = {rock: shadow.box for rock, shadow in shadows.cast(camera, "off", azimuth, labels).items()}
    yield "as labels cast them, of labelled rocks", cast


@dataclass(frozen=True)
class Propagated:
    """A terrain's knowledge, and from which exposures on its people drew shadows."""

    known: Known
    starts: ShadowStarts


def propagated(run: Run, options: LabelsOptions) -> Propagated:
    run.localise()
    localised = rigs.read_all_localised(run.folder / "cameras")
    drawings = read_drawings(run.folder / "seeds", run.terrain)
    starts = shadow_starts(drawings, options.shadow_start(run.terrain))
    suns = lamps.read_suns(run.folder / "cameras", localised)
    terrain = read_terrain(run.folder / "meshes", run.terrain)
    return Propagated(gather(terrain, localised, suns, choose_seeds(drawings, {}, starts), options), starts)


def fullest(truth: Truth) -> dict[tuple[str, CameraSide, Azimuth], np.ndarray]:
    """Shadows (n, 4) of the fullest file of each exposure bracket under a Sun lamp, rover light off."""
    found: dict[tuple[str, CameraSide, Azimuth], np.ndarray] = {}
    for key, annotated in sorted(truth.items(), key=lambda item: len(item[1][ROCK]) + len(item[1][SHADOW])):
        if key.light == "off" and key.azimuth in SUNS and len(annotated[SHADOW]):
            found[key.position, key.camera, key.azimuth] = annotated[SHADOW]
    return found


def score_causes(known: Known, truth: Truth, options: LabelsOptions) -> Iterator[tuple[str, Counts]]:
    annotated = fullest(truth)
    suns = known.world.suns
    meshes = build_world(known.terrain, TRIM, suns, options.wall_height_m)  # without stand-ins
    for position in sorted(known.localised):
        labels = PositionLabels(known, position, options)
        for camera in ("L", "R"):
            seen = Seen(meshes, labels.rocks.view(camera))
            for azimuth in SUNS:
                if (position, camera, azimuth) in annotated:
                    rocks = {label.rock: label.box for label in labels.rocks.labels(camera, azimuth)}
                    for name, boxes in causes(seen, suns[azimuth], rocks, labels.shadows, (camera, azimuth)):
                        found = np.array(list(boxes.values())).reshape(-1, 4)
                        yield name, count_boxes(annotated[position, camera, azimuth], found)


def score_ceilings(
    known: Known, starts: ShadowStarts, truth: Truth, options: LabelsOptions
) -> Iterator[tuple[str, Counts]]:
    for position in sorted(known.localised):
        labels = PositionLabels(known, position, options)
        left, right = labels.rocks.view("L"), labels.rocks.view("R")
        for azimuth in SUNS:
            annotated = labels.shadows.annotated("L", azimuth)
            if annotated is None:
                continue
            rocks = labels.rocks.labels("R", azimuth)
            found = clip(np.array([own.box for own in labels.shadows.labels("R", "off", azimuth, rocks, None)]))
            moved = move_flat(known.world, left, right, annotated)
            for key, boxes in truth.items():
                if (key.position, key.camera, key.azimuth) == (position, "R", azimuth):
                    yield from _ceilings(key, boxes[SHADOW], found, moved, starts)


def _ceilings(
    key: PhotoKey, true: np.ndarray, found: np.ndarray, moved: np.ndarray, starts: ShadowStarts
) -> Iterator[tuple[str, Counts]]:
    overlap = iou(found, true)
    own, other = match_sum(overlap)
    same = overlap[own, other] > 0.1
    own, other = own[same], other[same]
    first, second = moved[own], true[other]
    half = (first[:, 2:] - first[:, :2]) / 2
    told = {
        "true centre, size of the Left box": np.concatenate([centres(second) - half, centres(second) + half], axis=1),
        "mean of infinitely many drawings": second + (first - second) / np.sqrt(2),  # two differ by so much more
        "exact boxes": second,
    }
    boxes = {"ours": found, "the Left box moved like the ground": moved}
    for name, known in told.items():
        boxes[name] = found.copy()
        boxes[name][own] = known
    for name, all_of_them in boxes.items():
        inside = clip(all_of_them)
        inside = inside[area(inside) > 0]
        yield name, count_boxes(true, inside if key.exposure_ms >= starts.of(key) else inside[:0])
        yield f"{name}, start known", count_boxes(true, inside if len(true) else inside[:0])


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("release", type=Path)
    asked.add_argument("work", type=Path)
    asked.add_argument("--config", type=Path, default=Path("config/release.yaml"), help="whose options are used")
    asked.add_argument("--terrains", type=int, nargs="+", default=[1, 3, 4, 8, 11, 12])
    args = asked.parse_args()
    config = read_config(args.config)
    options = LabelsOptions(**config.labels.stage_options())
    counts: dict[str, dict[int, Counts]] = defaultdict(partial(defaultdict, Counts))
    for terrain in args.terrains:
        own = propagated(Run(args.release, args.work, terrain, config, config.labels.seeds.azimuths), options)
        truth = read_truth(args.release, terrain)
        print(f"terrain {terrain:02d}: {len(truth)} files", flush=True)
        for name, found in score_causes(own.known, truth, options):
            counts[name][terrain] += found
        for name, found in score_ceilings(own.known, own.starts, truth, options):
            counts[f"Left to Right: {name}"][terrain] += found
    for name, by_terrain in counts.items():
        pooled = sum(by_terrain.values(), Counts()).metrics()
        parts = ", ".join(f"{terrain:02d} {own.metrics()['f1'] or 0:.3f}" for terrain, own in by_terrain.items())
        print(f"{name:60s} F1 {pooled['f1'] or 0:.3f} mean IoU {pooled['miou'] or 0:.3f} ({parts})")


if __name__ == "__main__":
    main()

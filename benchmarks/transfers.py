"""Labels carried over the published release, task by task, against what people drew there.

`python benchmarks/transfers.py RELEASE WORK [--terrains 1 3 4 8 11] [--fit]`

RELEASE is the release's folder (Labels, TerrainMeshes). For every choice of seeds, cameras are located and meshes
placed by these seeds alone, in folders below WORK, which a second call takes up again. Truth is the file of each photo
set that has most boxes; for other exposures and lights it is every file.

`--fit` prints the coefficients of `polarsim/labels/habits.py` and of `polarsim/labels/confidence.py`, fitted to all
terrains given, and how well habits do on each terrain when fitted to the others.
"""

from __future__ import annotations

import argparse
import shutil
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from polarsim.acquire.seeds import best_exposure
from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import CamerasOptions
from polarsim.errors import FormatError
from polarsim.formats import lamps, release, rigs, yolo
from polarsim.formats.inventory import Inventory, write_inventory
from polarsim.formats.scene import TerrainMesh, read_terrain
from polarsim.geometry.boxes import area, iou, match
from polarsim.geometry.stereo import stated_rig
from polarsim.labels import confidence, habits
from polarsim.labels import label as label_module
from polarsim.labels.known import Known, gather
from polarsim.labels.label import Label
from polarsim.labels.lamps import with_refined_lamps
from polarsim.labels.options import LabelsOptions
from polarsim.labels.position import PositionLabels
from polarsim.labels.propagate import Starts, at_exposure
from polarsim.labels.seeds import Drawn, Seeds
from polarsim.labels.shadow_starts import ShadowStarts
from polarsim.labels.unlit import UnlitStarts
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, SUNS, Azimuth, PhotoKey
from polarsim.rocks.adopt import adopt_rocks
from polarsim.rocks.options import RocksOptions
from polarsim.tables.score import Counts, count_boxes

OPTIONS = LabelsOptions(visibility="annotator", shadow_start_ms_by_terrain={1: 32, 13: 32})
POSITIONS = "ABC"


@dataclass(frozen=True)
class Release:
    """The drawn files of one terrain, and the best of every photo set."""

    terrain: int
    files: dict[PhotoKey, Drawn]
    best: dict[tuple, PhotoKey]

    def drawn(self, position: str, light: str, azimuth: str, camera: str) -> Drawn | None:
        key = self.best.get((position, light, azimuth, camera))
        return self.files[key] if key else None

    def seeds(self, azimuths: Iterable[Azimuth] = SUNS) -> Seeds:
        """Left drawings, rover light off."""
        found: Seeds = {}
        for position in POSITIONS:
            for azimuth in azimuths:
                drawn = self.drawn(position, "off", azimuth, "L")
                if drawn is not None:
                    found.setdefault(position, {})["L", azimuth] = drawn
        return found


def read_release(root: Path, terrain: int) -> Release:
    files = {}
    for key, path in release.label_files(root, terrain).items():
        try:
            files[key] = Drawn.of(*yolo.read_boxes(path))
        except FormatError:
            continue
    sets: dict[tuple, dict[PhotoKey, int]] = defaultdict(dict)
    for key, drawn in files.items():
        sets[key.position, key.light, key.azimuth, key.camera][key] = len(drawn.rocks) + len(drawn.shadows)
    return Release(terrain, files, {name: best_exposure(counts) for name, counts in sets.items()})


@dataclass(frozen=True)
class Scene:
    """A terrain's meshes, poses and lamps, as some seeds place them."""

    mesh: TerrainMesh
    placed: dict[str, rigs.PlacedRig]
    suns: dict[str, np.ndarray]

    def known(self, seeds: Seeds) -> Known:
        known = gather(self.mesh, self.placed, self.suns, seeds, OPTIONS)
        return with_refined_lamps(known, SUNS, OPTIONS) if OPTIONS.refine_lamps else known


def scene_from(root: Path, work: Path, truth: Release, azimuths: Sequence[Azimuth]) -> Scene:
    """Cameras and meshes by the seeds of some azimuths alone."""
    folder = work / f"Terrain{truth.terrain:02d}_{'_'.join(azimuths)}"
    if not (folder / "done").exists():
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "seeds").mkdir(parents=True)
        files = release.label_files(root, truth.terrain)
        for position, drawings in truth.seeds(azimuths).items():
            for camera, azimuth in drawings:
                key = truth.best[position, "off", azimuth, camera]
                shutil.copyfile(files[key], folder / "seeds" / f"{key}.txt")
        _place(root, folder, truth.terrain)
        (folder / "done").touch()
    placed = rigs.read_all_placed(folder / "cameras")
    suns = lamps.read_suns(folder / "cameras", placed)
    return Scene(read_terrain(folder / "meshes", truth.terrain), placed, suns)


def _place(root: Path, folder: Path, terrain: int) -> None:
    meshes = {str(rock): str(path) for rock, path in release.mesh_files(root, terrain).items()}
    write_inventory(folder / "inventory.json", Inventory(terrain, "release", meshes=meshes))
    rigs.write_rig(folder / "calibration.json", stated_rig(), "stated")
    locate_cameras(
        terrain=terrain,
        positions=list(POSITIONS),
        inventory=folder / "inventory.json",
        calibration=folder / "calibration.json",
        seeds=folder / "seeds",
        cameras=folder / "cameras",
        options=CamerasOptions(),
        threads=1,
    )
    adopt_rocks(
        terrain=terrain,
        inventory=folder / "inventory.json",
        cameras=folder / "cameras",
        rocks=folder / "rocks.parquet",
        cuboids=folder / "cuboids.yaml",
        meshes=folder / "meshes",
        options=RocksOptions(),
    )


class Scores(dict[tuple[str, str], Counts]):
    """Counts by task and kind, and every label of a fit: kind, source, share of the azimuths, size, whether it hits.

    Shadows that the rover light casts have a source of their own there.
    """

    def __init__(self) -> None:
        super().__init__()
        self.labels: list[tuple[str, str, float, float, bool]] = []

    def add(self, task: str, truth: Drawn, found: Sequence[Label], kinds: Sequence[str] = BOX_CLASSES) -> None:
        for kind in kinds:
            drawn = truth.rocks if kind == ROCK else truth.shadows
            assert drawn is not None
            boxes = boxes_of(found, kind)
            self[task, kind] = self.get((task, kind), Counts()) + count_boxes(drawn, boxes)
            hits = set(match(iou(drawn, boxes))[1].tolist())
            for row, label in enumerate(label for label in found if label.kind == kind):
                size = float(np.sqrt(area(label.box)))
                source = f"{label.source}, rover" if kind == SHADOW and task.startswith("no Sun") else label.source
                self.labels.append((kind, source, label.confidence, size, row in hits))

    def show(self) -> None:
        for (task, kind), counts in self.items():
            if counts.tp + counts.fn:
                figures = counts.figures()
                named = " ".join(f"{name} {figures[name] or 0:.3f}" for name in ("precision", "recall", "f1", "miou"))
                print(f"{task:34s} {kind:6s} {named} n {figures['truth_boxes']}")


def boxes_of(labels: Sequence[Label], kind: str) -> np.ndarray:
    return np.array([label.box for label in labels if label.kind == kind]).reshape(-1, 4)


def score_from_all(truth: Release, scene: Scene, scores: Scores) -> None:
    """Other exposures, light on, the right camera, and photos without Sun, from seeds of all azimuths."""
    known = scene.known(truth.seeds())
    positions = {position: PositionLabels(known, position, OPTIONS) for position in scene.placed}
    seeds = {truth.best[position, "off", azimuth, "L"] for position in known.seeds for azimuth in SUNS}
    for key, drawn in truth.files.items():
        if key not in seeds and key.position in positions and key.azimuth in SUNS and key.camera == "L":
            labels = at_exposure(
                positions[key.position].labels("L", key.light, key.azimuth),
                key,
                Starts(ShadowStarts(OPTIONS.shadow_start(key.terrain)), UnlitStarts({})),
                OPTIONS,
            )
            scores.add("other exposures" if key.light == "off" else "light on", drawn, labels)
    for (position, light, azimuth, camera), key in truth.best.items():
        if position not in positions:
            continue
        labels = positions[position].labels(camera, light, azimuth)
        if azimuth == "no":
            scores.add(f"no Sun, rover light {light}", truth.files[key], labels)
        elif camera == "R" and light == "off":
            scores.add("Left to Right", truth.files[key], labels)
            scores.add(f"Left to Right, {truth.terrain:02d}", truth.files[key], labels)


def score_from_some(truth: Release, scene: Scene, azimuths: Sequence[Azimuth], scores: Scores) -> None:
    """Rocks at the azimuths that are not among the seeds; with three seeds, also shadows where rocks are known."""
    seeds, others = truth.seeds(azimuths), [azimuth for azimuth in SUNS if azimuth not in azimuths]
    task = "one azimuth to another" if len(azimuths) == 1 else "from the other three azimuths"
    known = scene.known(seeds)
    with_rocks: Seeds = {position: dict(drawings) for position, drawings in seeds.items()}
    for position in with_rocks:
        for azimuth in others:
            drawn = truth.drawn(position, "off", azimuth, "L")
            if drawn is not None:
                with_rocks[position]["L", azimuth] = replace(drawn, shadows=None)
    rocks_known = scene.known(with_rocks) if len(azimuths) > 1 else None
    for position in with_rocks:
        own = PositionLabels(known, position, OPTIONS)
        for azimuth in others:
            drawn = truth.drawn(position, "off", azimuth, "L")
            if drawn is None:
                continue
            scores.add(task, drawn, own.labels("L", "off", azimuth), [ROCK])
            if rocks_known is not None:
                labels = PositionLabels(rocks_known, position, OPTIONS).labels("L", "off", azimuth)
                scores.add("shadows where rocks are known", drawn, labels, [SHADOW])
                scores.add(f"shadows where rocks are known, {truth.terrain:02d}", drawn, labels, [SHADOW])


def score_projected(truth: Release, scene: Scene, scores: Scores) -> None:
    """Positions without a seed, their cameras known all the same: rocks that other positions or meshes know."""
    for position in scene.placed:
        others = {other: drawn for other, drawn in truth.seeds().items() if other != position}
        own = PositionLabels(scene.known(others), position, OPTIONS)
        for azimuth in SUNS:
            drawn = truth.drawn(position, "off", azimuth, "L")
            if drawn is not None:
                scores.add("position without seed", drawn, own.labels("L", "off", azimuth))


@dataclass(frozen=True)
class CastPairs:
    """Shadows as cast and as drawn by the same rock: terms (n, 4, t), boxes (n, 4) each."""

    terms: np.ndarray
    cast: np.ndarray
    drawn: np.ndarray


def cast_pairs(truth: Release, scene: Scene) -> CastPairs:
    """Every drawn shadow of the seeds beside the one that geometry alone gives."""
    learnt, habits.COEFFICIENTS = habits.COEFFICIENTS, np.zeros(len(habits.TERMS))
    known = scene.known(truth.seeds())
    rows = []
    for position in known.seeds:
        own = PositionLabels(known, position, OPTIONS)
        for azimuth in SUNS:
            labels = own.labels("L", "off", azimuth)
            rocks = {label.rock: label.box for label in labels if label.kind == ROCK}
            cast = own.shadows.cast("L", "off", azimuth, rocks)
            for label in labels:
                if label.kind == SHADOW and label.rock in cast:
                    shown = own.rocks.projected("L", label.rock)
                    rock, box = rocks[label.rock], cast[label.rock].box
                    mesh = shown.box if shown else rock
                    terms = habits.terms(box, rock, mesh, own.rocks.px_per_m("L", label.rock))
                    rows.append((terms, box, label.box))
    habits.COEFFICIENTS = learnt
    terms, cast_boxes, drawn = (np.array(column) for column in zip(*rows, strict=True))
    return CastPairs(terms, cast_boxes, drawn)


def fitted(pairs: Sequence[CastPairs], rounds: int = 20, scale: float = 1.5) -> np.ndarray:
    """(t,) coefficients by iterated least squares with Cauchy weights."""
    terms = np.concatenate([one.terms for one in pairs]).reshape(-1, len(habits.TERMS))
    moved = np.concatenate([(one.drawn - one.cast) * habits.OUTWARD.sum(axis=1) for one in pairs]).reshape(-1)
    found = np.zeros(terms.shape[1])
    for _ in range(rounds):
        error = moved - terms @ found
        weight = 1 / (1 + (error / (scale * 1.4826 * np.median(np.abs(error)))) ** 2)
        found = np.linalg.lstsq(terms * weight[:, None] ** 0.5, moved * weight**0.5, rcond=None)[0]
    return found


def fit_confidence(labels: Sequence[tuple[str, str, float, float, bool]]) -> None:
    """Print logistic regressions of hits on share and size, by kind and source."""
    for kind, source in sorted({label[:2] for label in labels}):
        own = [label for label in labels if label[:2] == (kind, source)]
        share, size, hit = (np.array([label[column] for label in own], float) for column in (2, 3, 4))
        terms = np.stack([np.ones(len(own)), share - 1, np.log(size / confidence.USUAL_PX)], axis=1)

        def loss(x: np.ndarray, terms: np.ndarray = terms, hit: np.ndarray = hit) -> float:
            score = terms @ x
            return float(np.logaddexp(0, score).sum() - score @ hit + 0.5 * (x**2).sum())

        found = minimize(loss, np.zeros(3)).x.round(2).tolist()
        print(f"    ({kind!r}, {source!r}): {tuple(found)},  # {len(own)} labels, {hit.mean():.3f} right")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("release", type=Path)
    asked.add_argument("work", type=Path)
    asked.add_argument("--terrains", type=int, nargs="+", default=[1, 3, 4, 8, 11])
    asked.add_argument("--fit", action="store_true")
    asked.add_argument("--quick", action="store_true", help="only what needs seeds of all azimuths")
    asked.add_argument("--refine-lamps", action="store_true", help="by the seeds' shadows, as labels.refine_lamps does")
    args = asked.parse_args()
    global OPTIONS
    OPTIONS = OPTIONS.model_copy(update={"refine_lamps": args.refine_lamps})
    truths = {terrain: read_release(args.release, terrain) for terrain in args.terrains}
    pairs = {}
    if args.fit:
        pairs = {t: cast_pairs(truth, scene_from(args.release, args.work, truth, SUNS)) for t, truth in truths.items()}
        print("COEFFICIENTS", dict(zip(habits.TERMS, fitted(list(pairs.values())).round(4).tolist(), strict=True)))
        label_module.confidence = lambda *given, **_: given[2]  # the bare share
    scores = Scores()
    for terrain, truth in truths.items():
        if args.fit:  # what the others taught
            habits.COEFFICIENTS = fitted([other for t, other in pairs.items() if t != terrain])
        score_from_all(truth, scene_from(args.release, args.work, truth, SUNS), scores)
        for azimuth in SUNS if not args.quick else ():
            others = [other for other in SUNS if other != azimuth]
            for azimuths in ([azimuth], others):
                score_from_some(truth, scene_from(args.release, args.work, truth, azimuths), azimuths, scores)
        score_projected(truth, scene_from(args.release, args.work, truth, SUNS), scores)
    scores.show()
    if args.fit:
        fit_confidence(scores.labels)


if __name__ == "__main__":
    main()

"""Score labels of `snakemake labels` for the published release against human annotations, by task and file.

`python benchmarks/transfers.py RELEASE WORK [--config config/release.yaml] [--terrains 1 3 4 8 11 12] [--fit]`

RELEASE is the release's folder (Labels, TerrainMeshes). For each choice of seeds, the stages run as in a normal run:
raw files, cameras, meshes, labels, with the options of the configuration, in folders below WORK that a second call
reuses. Seeds are those of the configuration: left, rover light off, the exposure with most boxes of each azimuth. The
ground truth is every readable published file; unreadable files are printed.

`--fit` prints the coefficients of `polarsim/labels/label.py`, fitted to all given terrains, and scores each terrain
with an annotator model fitted to the rest; `python -m polarsim.labels.fit_annotator` fits the model that polarsim uses.

`--ceilings` scores upper bounds instead: boxes at the mean of infinitely many annotations of a rock, with presence as
annotated under other lamps, or as in the ground truth.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.acquire.index import index_terrain
from polarsim.acquire.options import SourceOptions
from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.surveyed import expected_survey_pose
from polarsim.config import Config, read_config
from polarsim.errors import FormatError
from polarsim.formats import release, yolo
from polarsim.formats.tables import read_parquet
from polarsim.geometry.boxes import area, clip, iou, match_by_iou
from polarsim.labels.annotator import Annotator
from polarsim.labels.association import TerrainRocks, Track, associate_rocks
from polarsim.labels.fit_annotator import (
    AnnotatorSamples,
    TerrainFiles,
    fit_annotator,
    fit_logistic,
    read_published,
    rover_light_samples,
    shadow_edge_samples,
)
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.label import COEFFICIENTS, REFERENCE_PX
from polarsim.labels.options import LabelsOptions, rig_lamp_ms
from polarsim.labels.projection import move_rocks
from polarsim.labels.propagate import PropagationInputs, propagate_labels
from polarsim.labels.seeds import AnnotatedBoxes, AnnotationKey, Seeds
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, Azimuth, PhotoKey
from polarsim.rocks.adopt import adopt_rocks
from polarsim.run_files import lamps, rigs
from polarsim.run_files.scene import read_terrain
from polarsim.scoring.score import MatchCounts, count_boxes
from polarsim.site import polar

POSITIONS = "ABC"
EDGES = ["x0", "y0", "x1", "y1"]
MIN_ANNOTATION_IOU = 0.1  # minimum IoU of an annotated box with the mean of a rock's other annotations

Truth = dict[PhotoKey, dict[str, np.ndarray]]  # boxes (n, 4) by kind


def read_truth(root: Path, terrain: int) -> Truth:
    """Read the readable label files of a terrain, and print the errors of the rest."""
    truth: Truth = {}
    for key, path in release.label_files(root, terrain).items():
        try:
            classes, boxes = yolo.read_boxes(path, size=polar().images.size)
        except FormatError as error:
            print(f"skipped: {error}")
            continue
        truth[key] = {kind: boxes[classes == number] for number, kind in enumerate(BOX_CLASSES)}
    return truth


@dataclass(frozen=True)
class Run:
    """Terrain labelled from some seeds, with a folder of the stages' outputs."""

    root: Path
    work: Path
    terrain: int
    config: Config
    azimuths: tuple[Azimuth, ...]
    seeded: str = POSITIONS
    unlocalised: str = ""  # a position that keeps its surveyed pose

    @property
    def folder(self) -> Path:
        return (
            self.work / f"Terrain{self.terrain:02d}_{'_'.join(self.azimuths)}_{self.seeded}{self.unlocalised.lower()}"
        )

    @property
    def seeds(self) -> set[PhotoKey]:
        return {PhotoKey.parse(path.stem) for path in (self.folder / "seeds").glob("*.txt")}

    def localise(self) -> None:
        """Convert raw files to cameras and meshes, once."""
        if (self.folder / "placed").exists():
            return
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        at = {name: self.folder / name for name in ("photos.parquet", "calibration.json", "inventory.json", "seeds")}
        index_terrain(
            site=polar(),
            terrain=self.terrain,
            positions=list(self.seeded),
            source=SourceOptions(kind="release", root=self.root),
            seed_options=self.config.labels.seeds.model_copy(update={"azimuths": self.azimuths, "root": None}),
            photos=at["photos.parquet"],
            calibration=at["calibration.json"],
            inventory=at["inventory.json"],
            seeds=at["seeds"],
        )
        locate_cameras(
            site=polar(),
            terrain=self.terrain,
            positions=list(POSITIONS),
            inventory=at["inventory.json"],
            calibration=at["calibration.json"],
            seeds=at["seeds"],
            cameras=self.folder / "cameras",
            options=self.config.cameras.localisation,
        )
        if self.unlocalised:
            self._forget_pose(self.folder / "cameras" / f"Pos{self.unlocalised}.json")
        adopt_rocks(
            site=polar(),
            terrain=self.terrain,
            inventory=at["inventory.json"],
            cameras=self.folder / "cameras",
            rocks=self.folder / "rocks.parquet",
            cuboids=self.folder / "cuboids.yaml",
            meshes=self.folder / "meshes",
        )
        (self.folder / "placed").touch()

    def _forget_pose(self, path: Path) -> None:
        localised = rigs.read_all_localised(path.parent)
        rig = localised.pop(self.unlocalised)
        likely = expected_survey_pose(
            self.unlocalised,
            {position: one.sandbox_from_left for position, one in localised.items()},
            polar().tripods_of(self.terrain),
        )
        assert likely is not None
        pose, pitch_sd_deg = likely
        rigs.write_localised(path, rigs.LocalisedRig(rig.rig, pose, rigs.SURVEYED, {rigs.PITCH_SD: pitch_sd_deg}))

    def labels(
        self, keys: Sequence[PhotoKey], options: LabelsOptions, out: Path, annotator: Annotator | None = None
    ) -> pd.DataFrame:
        """Return the label table of some photos, and write it with the boxes to a folder."""
        self.localise()
        names = ("photos.parquet", "inventory.json", "seeds", "cameras", "meshes")
        inputs = PropagationInputs(
            polar(), self.terrain, keys, *(self.folder / name for name in names), annotator=annotator
        )
        propagate_labels(inputs, boxes=out / "boxes", table=out / "labels.parquet", options=options)
        return read_parquet(out / "labels.parquet")


@dataclass
class Scores:
    """Counts by task, kind and terrain, and every label with its result."""

    counts: dict[tuple[str, str, int], MatchCounts] = field(default_factory=dict)
    labels: list[pd.DataFrame] = field(default_factory=list)

    def add(self, task: str, key: PhotoKey, truth: dict[str, np.ndarray], labels: pd.DataFrame) -> None:
        for kind, annotated in truth.items():
            found = labels[labels["kind"] == kind]
            boxes = found[EDGES].to_numpy(float)
            name = task, kind, key.terrain
            self.counts[name] = self.counts.get(name, MatchCounts()) + count_boxes(annotated, boxes)
            hits = np.isin(np.arange(len(found)), match_by_iou(iou(annotated, boxes))[1])
            self.labels.append(found.assign(hit=hits, size=np.sqrt(area(boxes)), no_lamp=key.azimuth == "no"))

    def show(self) -> None:
        for task, kind in dict.fromkeys((task, kind) for task, kind, _ in self.counts):
            own = {terrain: counts for (t, k, terrain), counts in self.counts.items() if (t, k) == (task, kind)}
            pooled = sum(own.values(), MatchCounts())
            if not pooled.tp + pooled.fn:
                continue
            values = pooled.metrics()
            named = " ".join(f"{name} {values[name] or 0:.3f}" for name in ("precision", "recall", "f1", "miou"))
            by_terrain = ", ".join(f"{terrain:02d} {own[terrain].metrics()['f1'] or 0:.3f}" for terrain in sorted(own))
            print(f"{task:36s} {kind:6s} {named} n {values['truth_boxes']} (F1 {by_terrain})")


def task_of(key: PhotoKey) -> str:
    """Return the task of a photo of a run with seeds of all azimuths."""
    if key.azimuth == "no":
        return f"no lamp, rover light {key.light}"
    if key.camera == "R":
        return "Left to Right" if key.light == "off" else "Left to Right, light on"
    return "other exposures" if key.light == "off" else "light on"


def score_run(
    run: Run,
    truth: Truth,
    task: str | None,
    options: LabelsOptions,
    scores: Scores,
    annotator: Annotator | None,
) -> None:
    """Score every file in `truth` that is not a seed."""
    run.localise()
    wanted = {key: annotated for key, annotated in truth.items() if key not in run.seeds}
    table = run.labels(sorted(wanted), options, run.folder, annotator)
    rows = dict(iter(table.groupby("key")))
    for key, annotated in wanted.items():
        scores.add(task or task_of(key), key, annotated, rows.get(str(key), table[:0]))


def partial_runs(run: Run, truth: Truth) -> Iterator[tuple[Run, Truth, str]]:
    """Yield runs with seeds of one azimuth, of three, and of two positions, with their left photos, light off."""
    left = {key: annotated for key, annotated in truth.items() if (key.camera, key.light) == ("L", "off")}
    for azimuth in polar().suns:
        others = tuple(other for other in polar().suns if other != azimuth)
        rocks = {key: {ROCK: annotated[ROCK]} for key, annotated in left.items()}
        elsewhere = {key: annotated for key, annotated in rocks.items() if key.azimuth in others}
        there = {key: annotated for key, annotated in rocks.items() if key.azimuth == azimuth}
        yield with_seeds(run, (azimuth,), POSITIONS), elsewhere, "one azimuth to another"
        yield with_seeds(run, others, POSITIONS), there, "from the other three azimuths"
    for position in POSITIONS:
        own = {
            key: annotated
            for key, annotated in left.items()
            if key.position == position and key.azimuth in polar().suns
        }
        yield with_seeds(run, run.azimuths, POSITIONS.replace(position, "")), own, "position without seed"
        yield from unlocalised_run(run, truth, position)


def unlocalised_run(run: Run, truth: Truth, position: str) -> Iterator[tuple[Run, Truth, str]]:
    """Yield a run with a position without localised cameras."""
    lost = replace(run, unlocalised=position)
    suns = {
        key: annotated for key, annotated in truth.items() if key.position == position and key.azimuth in polar().suns
    }
    for camera, task in (("L", "not placed, other Left photos"), ("R", "not placed, Left to Right")):
        yield lost, {key: annotated for key, annotated in suns.items() if key.camera == camera}, task


def with_seeds(run: Run, azimuths: tuple[Azimuth, ...], seeded: str) -> Run:
    return replace(run, azimuths=azimuths, seeded=seeded)


@dataclass(frozen=True)
class Drawing:
    """Rocks of a position for a file: boxes (n, 4) at the mean of infinitely many annotations, and their presence."""

    boxes: np.ndarray
    tracks: list[Track]
    shown: np.ndarray  # (n,) bool

    def under(self, drawings: Iterable[AnnotationKey]) -> np.ndarray:
        """Return the number (n,) of the given annotations that contain each rock."""
        asked = set(drawings)
        return np.array([len(asked & set(track.rows)) for track in self.tracks], int)


def both_cameras(run: Run, truth: Truth) -> TerrainRocks:
    """Return the annotations of both cameras under Sun lamps: of each the file with most rocks."""
    run.localise()
    localised = rigs.read_all_localised(run.folder / "cameras")
    seeds: Seeds = {}
    fullest = sorted(truth, key=lambda key: (len(truth[key][ROCK]), -abs(np.log2(key.exposure_ms / 256)), key))
    for key in fullest:
        if key.light == "off" and key.azimuth in polar().suns:
            seeds.setdefault(key.position, {})[key.camera, key.azimuth] = AnnotatedBoxes(truth[key][ROCK], None)
    suns = lamps.read_suns(run.folder / "cameras", localised, polar(), run.terrain)
    return associate_rocks(
        read_terrain(run.folder / "meshes", run.terrain, polar().sandbox_of(run.terrain)),
        localised,
        suns,
        polar().rig_lamp,
        seeds,
    )


def best_boxes(known: TerrainRocks, key: PhotoKey, annotated: np.ndarray, options: LabelsOptions) -> Drawing:
    """Return the rocks of all annotations of a position, for a file with boxes `annotated` (m, 4).

    The distance between an annotated box and the mean of n other annotations is sqrt((n + 1) / n) times the noise of
    an annotation; for infinitely many it would equal the noise. Therefore the mean is moved towards the annotated box
    to this distance.
    """
    rocks = PositionRocks(known, key.position, options)
    means, counts, tracks = [], [], []
    for row, track in enumerate(known.tracks[key.position]):
        same = [drawing for drawing in track.rows if drawing[0] == key.camera and drawing[1] != key.azimuth]
        drawings = same or [drawing for drawing in track.rows if drawing[0] != key.camera] or list(track.rows)
        source = drawings[0][0]
        mean = np.mean([known.seeds[key.position][drawing].rocks[track.rows[drawing]] for drawing in drawings], axis=0)
        if source != key.camera:
            views = rocks.view(source), rocks.view(key.camera)
            mean = move_rocks(known.world, *views, mean[None], rocks.ids[[row]])[0]
        means.append(mean)
        counts.append(len(drawings))
        tracks.append(track)
    boxes, others = np.array(means).reshape(-1, 4), np.array(counts, float)[:, None]
    rows, columns = match_by_iou(iou(annotated, boxes), MIN_ANNOTATION_IOU)
    boxes[columns] = annotated[rows] + np.sqrt(others / (others + 1))[columns] * (boxes[columns] - annotated[rows])
    return Drawing(clip(boxes, 1936, 1216), tracks, np.isin(np.arange(len(boxes)), columns))


def score_ceilings(run: Run, truth: Truth, options: LabelsOptions, scores: Scores) -> None:
    """Score perfect boxes of every annotated file, with presence chosen in several ways."""
    known = both_cameras(run, truth)
    for key, annotated in truth.items():
        if key.position not in known.tracks:
            continue
        best = best_boxes(known, key, annotated[ROCK], options)
        others = [azimuth for azimuth in polar().suns if azimuth != key.azimuth]
        chosen = {"presence known": best.shown}
        if key.azimuth == "no":
            task = task_of(key)
            seen = best.shown & (key.light == "off" or key.exposure_ms >= rig_lamp_ms(polar()))
            chosen["presence known from the usual exposure on"] = seen
            chosen["in half of the Left drawings"] = best.under(("L", azimuth) for azimuth in polar().suns) >= 2
        elif key.camera == "R":
            task = task_of(key)
            chosen["as Left has it"] = best.under([("L", key.azimuth)]) == 1
        elif key.light == "off":
            task = "other azimuths"
            chosen["as Right has it"] = best.under([("R", key.azimuth)]) == 1
            chosen["in two of the three others"] = best.under(("L", azimuth) for azimuth in others) >= 2
            for azimuth in others:
                in_one = best.under([("L", azimuth)]) == 1
                scores.add(f"{task}, as one other has it", key, {ROCK: annotated[ROCK]}, as_labels(best.boxes[in_one]))
        else:
            continue
        for name, rows in chosen.items():
            scores.add(f"{task}, {name}", key, {ROCK: annotated[ROCK]}, as_labels(best.boxes[rows]))


def as_labels(boxes: np.ndarray) -> pd.DataFrame:
    """Return the columns of a label table that scoring uses."""
    return pd.DataFrame(boxes, columns=EDGES).assign(kind=ROCK)


def fit_confidence(labels: pd.DataFrame) -> None:
    """Print logistic regressions of hits on share and size, by kind and source."""
    labels = labels[~(labels["no_lamp"] & (labels["kind"] == ROCK) & (labels["source"] == "fused"))]  # `rover_light`
    rover = labels["no_lamp"] & (labels["kind"] == SHADOW)
    for (kind, source, by_rover), own in labels.groupby(["kind", "source", rover]):
        share = shares_right(own, kind, source) if not by_rover else np.ones(len(own))
        hit = own["hit"].to_numpy(float)
        terms = np.stack([np.ones(len(own)), share - 1, np.log(own["size"] / REFERENCE_PX)], axis=1)
        found = fit_logistic(AnnotatorSamples(terms, hit))
        name = f"{kind!r}, {source!r}{', rover light' if by_rover else ''}"
        print(f"    ({name}): {found},  # {len(own)} labels, {hit.mean():.3f} right")


def shares_right(labels: pd.DataFrame, kind: str, source: str) -> np.ndarray:
    """Return the shares (n,) of the azimuths from the confidences of labels."""
    start, missed, size = COEFFICIENTS[kind, source]
    if not missed or source != "fused":
        return np.ones(len(labels))
    told = labels["confidence"].to_numpy(float).clip(1e-6, 1 - 1e-6)
    score = np.log(told / (1 - told))
    return np.asarray((score - start - size * np.log(labels["size"].clip(1) / REFERENCE_PX)) / missed + 1)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("release", type=Path)
    asked.add_argument("work", type=Path)
    asked.add_argument("--config", type=Path, default=Path("config/release.yaml"), help="configuration of the options")
    asked.add_argument("--terrains", type=int, nargs="+", default=[1, 3, 4, 8, 11, 12])
    asked.add_argument("--fit", action="store_true")
    asked.add_argument("--ceilings", action="store_true", help="score upper bounds instead of our method")
    asked.add_argument("--quick", action="store_true", help="only tasks with seeds of all azimuths")
    args = asked.parse_args()
    config = read_config(args.config)
    options = LabelsOptions(**config.labels.stage_options())
    seeded = config.labels.seeds.azimuths
    runs = {terrain: Run(args.release, args.work, terrain, config, seeded) for terrain in args.terrains}
    scores = Scores()
    if args.ceilings:
        for terrain, run in runs.items():
            score_ceilings(run, read_truth(args.release, terrain), options, scores)
        scores.show()
        return
    edges, rover_light = {}, {}
    for terrain, run in runs.items() if args.fit else ():
        run.localise()
        files = TerrainFiles(polar(), terrain, run.folder / "seeds", run.folder / "cameras", run.folder / "meshes")
        edges[terrain] = shadow_edge_samples(files, options)
        rover_light[terrain] = rover_light_samples(files, read_published(args.release, polar(), terrain), options)
    for terrain, run in runs.items():
        annotator = None
        if args.fit:  # fitted to the other terrains
            others = [other for other in runs if other != terrain]
            annotator = fit_annotator([edges[other] for other in others], [rover_light[other] for other in others])
        truth = read_truth(args.release, terrain)
        print(f"terrain {terrain:02d}: {len(truth)} files", flush=True)
        score_run(run, truth, None, options, scores, annotator)
        for part, wanted, task in () if args.quick else partial_runs(run, truth):
            score_run(part, wanted, task, options, scores, annotator)
    scores.show()
    if args.fit:
        fit_confidence(pd.concat(scores.labels, ignore_index=True))


if __name__ == "__main__":
    main()

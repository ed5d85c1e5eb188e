"""Fit the coefficients of `annotator.json` to human labels.

    python -m polarsim.labels.fit_annotator RUN RELEASE [--terrains 1 3] [--out annotator.json]

RUN is the folder of a run with a finished labels stage, such as results/release; RELEASE contains the published labels.
Shadow edges are fitted to the seeds of the run. The probability of rocks under the rover light is fitted to the
published label files of photos without a Sun lamp.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from polarsim.errors import FormatError
from polarsim.formats import release, yolo
from polarsim.formats.files import write_json
from polarsim.formats.yaml_files import read_yaml
from polarsim.geometry.boxes import iou, match_by_iou
from polarsim.labels.annotator import (
    EDGE_TERMS,
    NO_HABITS,
    OUTWARD,
    ROVER_LIGHT_TERMS,
    Annotator,
    edge_terms,
)
from polarsim.labels.association import TerrainRocks, associate_rocks
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.options import LabelsOptions, rig_lamp_ms
from polarsim.labels.propagate import PositionLabels
from polarsim.labels.seeds import AnnotatedBoxes, MinExposures, choose_seeds, read_seeds
from polarsim.photo import ROCK, SHADOW, CameraSide, PhotoKey, Terrain, parse_terrain, terrain_text
from polarsim.run_files import lamps, rigs
from polarsim.run_files.run import Run
from polarsim.run_files.scene import read_terrain
from polarsim.site import Site

log = logging.getLogger(__name__)

ROUNDS, SCALE = 20, 1.5  # robust fit: number of reweightings, Cauchy scale in robust standard deviations


@dataclass(frozen=True)
class TerrainFiles:
    """Output files of a run for one terrain."""

    site: Site
    terrain: Terrain
    seeds: Path
    cameras: Path
    meshes: Path

    @classmethod
    def of_run(cls, run: Path, terrain: Terrain) -> TerrainFiles:
        name = f"Terrain{terrain_text(terrain)}"
        return cls(
            Run(run).site, terrain, run / "acquire" / name / "seeds", run / "cameras" / name, run / "meshes" / name
        )

    def known(self, options: LabelsOptions) -> TerrainRocks:
        """Return the bodies, poses and annotated rocks of the terrain."""
        localised = rigs.read_all_localised(self.cameras)
        site = self.site
        drawings = read_seeds(self.seeds, self.terrain, site.images.size)
        shadows_ms = options.shadow_start(self.terrain, site.usual_exposure_ms)
        seeds = choose_seeds(drawings, {}, MinExposures.of(drawings, shadows_ms, rig_lamp_ms(site)))
        suns = lamps.read_suns(self.cameras, localised, site, self.terrain)
        sandbox = site.sandbox_of(self.terrain)
        scene = read_terrain(self.meshes, self.terrain, sandbox, cameras=self.cameras)
        return associate_rocks(scene, localised, suns, site.rig_lamp, seeds)


def read_published(root: Path, site: Site, terrain: Terrain) -> dict[PhotoKey, AnnotatedBoxes]:
    """Read the published label files of a terrain. Invalid files are skipped with a warning."""
    annotated = {}
    for key, path in release.label_files(root, terrain, site.key).items():
        try:
            annotated[key] = AnnotatedBoxes.of(*yolo.read_boxes(path, site.images.size))
        except FormatError as error:
            log.warning("skipped: %s", error)
    return annotated


@dataclass(frozen=True)
class AnnotatorSamples:
    """Terms (n, t) of a model and observed values (n,)."""

    terms: np.ndarray
    observed: np.ndarray

    @classmethod
    def joined(cls, parts: Iterable[AnnotatorSamples]) -> AnnotatorSamples:
        parts = list(parts)
        return cls(np.concatenate([part.terms for part in parts]), np.concatenate([part.observed for part in parts]))


def shadow_edge_samples(files: TerrainFiles, options: LabelsOptions) -> AnnotatorSamples:
    """Return the shifts of edges, px, from the box of a cast shadow to the annotated box."""
    terrain_rocks = files.known(options)
    terms, moves = [np.zeros((0, len(EDGE_TERMS)))], [np.zeros(0)]
    for position in terrain_rocks.seeds:
        position_labels = PositionLabels(terrain_rocks, position, options, annotator=NO_HABITS)
        for azimuth in files.site.suns:
            labels = position_labels.labels("L", "off", azimuth)
            rocks = {label.rock: label.box for label in labels if label.kind == ROCK}
            cast = position_labels.shadows.cast("L", "off", azimuth, rocks)
            for label in labels:
                if (label.kind, label.source) == (SHADOW, "seed") and label.rock in cast:
                    projected = position_labels.rocks.projected("L", label.rock)
                    rock, box = rocks[label.rock], cast[label.rock].box
                    scale = position_labels.rocks.px_per_m("L", label.rock)
                    terms.append(edge_terms(box, rock, projected.box if projected else rock, scale))
                    moves.append((label.box - box) * OUTWARD.sum(axis=1))
    return AnnotatorSamples(np.concatenate(terms), np.concatenate(moves))


def rover_light_samples(
    files: TerrainFiles, annotated: Mapping[PhotoKey, AnnotatedBoxes], options: LabelsOptions
) -> AnnotatorSamples:
    """Return the share of the label files of each exposure bracket under the rover light that contain a rock.

    `annotated` are the label files of all photos. The rocks are annotated under Sun lamps.
    """
    terrain_rocks = files.known(options)
    brackets: dict[tuple[str, CameraSide], list[np.ndarray]] = {}
    for key, boxes in annotated.items():
        if (key.has_sun, key.light) == (False, "on") and key.exposure_ms >= rig_lamp_ms(files.site):
            brackets.setdefault((key.position, key.camera), []).append(boxes.rocks)
    terms, hit = [np.zeros((0, len(ROVER_LIGHT_TERMS)))], [np.zeros(0)]
    for (position, camera), drawings in brackets.items():
        rocks = PositionRocks(terrain_rocks, position, options)
        fused = rocks.fused(camera)
        matched = [np.isin(np.arange(len(fused)), match_by_iou(iou(drawing, fused))[1]) for drawing in drawings]
        terms += [rocks.rover_light_terms(camera, row)[None] for row in range(len(fused))]
        hit.append(np.mean(matched, axis=0))
    return AnnotatorSamples(np.concatenate(terms), np.concatenate(hit))


def fit_edges(samples: AnnotatorSamples) -> tuple[float, ...]:
    """Return coefficients of edge shifts by iteratively reweighted least squares with Cauchy weights."""
    coefficients = np.zeros(samples.terms.shape[1])
    for _ in range(ROUNDS):
        error = samples.observed - samples.terms @ coefficients
        weight = np.sqrt(1 / (1 + (error / (SCALE * 1.4826 * np.median(np.abs(error)))) ** 2))
        coefficients = np.linalg.lstsq(samples.terms * weight[:, None], samples.observed * weight, rcond=None)[0]
    return tuple(coefficients.round(4).tolist())


def fit_logistic(samples: AnnotatorSamples) -> tuple[float, ...]:
    """Return coefficients of a logistic regression with a unit Gaussian prior."""
    terms, hit = samples.terms, samples.observed

    def loss(x: np.ndarray) -> float:
        score = terms @ x
        return float(np.logaddexp(0, score).sum() - score @ hit + 0.5 * (x**2).sum())

    return tuple(minimize(loss, np.zeros(terms.shape[1])).x.round(2).tolist())


def fit_annotator(edges: Iterable[AnnotatorSamples], rover_light: Iterable[AnnotatorSamples]) -> Annotator:
    """Fit both models to the samples of several terrains."""
    return Annotator(fit_edges(AnnotatorSamples.joined(edges)), fit_logistic(AnnotatorSamples.joined(rover_light)))


def write_annotator(path: Path, annotator: Annotator, fitted_to: str) -> None:
    """Write a file for `read_annotator`; `fitted_to` is the name of the data."""
    rules = {
        "shadow_edges": dict(zip(EDGE_TERMS, annotator.edges, strict=True)),
        "rover_light": dict(zip(ROVER_LIGHT_TERMS, annotator.rover_light, strict=True)),
    }
    command = "python -m polarsim.labels.fit_annotator"
    parts = {
        name: {"fitted_to": fitted_to, "command": command, "coefficients": values} for name, values in rules.items()
    }
    write_json(path, parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("release", type=Path)
    parser.add_argument("--terrains", type=parse_terrain, nargs="+", default=[1, 3, 4, 8, 11, 12])
    parser.add_argument("--out", type=Path, default=Path("annotator.json"))
    args = parser.parse_args()
    section = read_yaml(args.run / "config.yaml").get("labels", {})
    options = LabelsOptions(**{key: value for key, value in section.items() if key != "seeds"})
    edges, rover_light = [], []
    for terrain in args.terrains:
        files = TerrainFiles.of_run(args.run, terrain)
        edges.append(shadow_edge_samples(files, options))
        rover_light.append(rover_light_samples(files, read_published(args.release, files.site, terrain), options))
        print(
            f"terrain {terrain_text(terrain)}: {len(edges[-1].terms)} edges, {len(rover_light[-1].terms)} rocks",
            flush=True,
        )
    terrains = ", ".join(f"{terrain_text(terrain)}" for terrain in args.terrains)
    write_annotator(args.out, fit_annotator(edges, rover_light), f"{args.run}, labels of terrains {terrains}")


if __name__ == "__main__":
    main()

"""Metrics of every detector on every domain, and of the difference between domains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.detect.breakdown import (
    ALL,
    BREAKDOWN_COLUMNS,
    breakdown,
    curves,
    match_predictions,
)  # fmt: skip
from polarsim.detect.dataset import count_left_out, dataset_images
from polarsim.detect.detectors import detector_name
from polarsim.detect.differences import DIFFERENCE_COLUMNS, SIDE_COLUMNS, paired_differences
from polarsim.detect.domain_evaluation import DomainEvaluation
from polarsim.detect.false_positives import FALSE_POSITIVE_COLUMNS, false_positives
from polarsim.detect.grouping import BOX_COLUMNS
from polarsim.detect.ipd import (
    ROCK_COLUMNS,
    IpdRules,
    instance_performance_difference,
    pair_rock_labels,
    rock_means,
)  # fmt: skip
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.predict import PREDICTION_COLUMNS
from polarsim.detect.split import PHOTO, TEST, TRAIN, VAL, read_split, shared_units
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES
from polarsim.progress import track
from polarsim.schemas.detect import CURVES, DETECTION, INSTANCES, IPD

IPD_PAIR_COLUMNS = ("trained", "first", "second")
DETECTION_COLUMNS = DETECTION.without("seed")
IPD_COLUMNS = IPD.without("split", "seed")
Sides = tuple[str, str]  # training domain and evaluated domain of a detector


def evaluate(
    *,
    predictions: Sequence[Path],
    labels: Mapping[str, Path],
    datasets: Mapping[str, Path],
    split: Path,
    by: str = PHOTO,
    tables_of: Mapping[str, Path],
    size: tuple[int, int],
    options: ComparisonOptions,
    training: TrainingOptions,
    imgsz: int,
) -> None:
    """Write the metrics of all pairs of domains.

    Parameters
    ----------
    predictions : sequence of Path
        Files named `<trained>_on_<evaluated>.parquet`.
    labels, datasets : mapping of str to Path
        Label table of each evaluated domain, and data set of each domain. Only images in the test part are evaluated.
    split : Path
        Split of the data sets by photo, view, position or terrain.
    tables_of : mapping of str to Path
        Tables to write: detection, breakdown, curves, false_positives, ipd, rocks, instances, differences.
    size : (int, int)
        Width and height of the photos, px.
    training, imgsz
        Training options of the detectors and longer side of their input, px, for the tables.
    """
    leaked = bool(shared_units(read_split(split, by), "view"))
    truth = {domain: read_evaluation_labels(path, size) for domain, path in labels.items()}
    evaluations: dict[Sides, DomainEvaluation] = {}
    for path in sorted(predictions):
        trained, _, evaluated = path.stem.partition("_on_")
        evaluations[trained, evaluated] = DomainEvaluation(
            dataset_images(datasets[evaluated], TEST),
            truth[evaluated],
            tables.read_parquet(path, PREDICTION_COLUMNS),
            options,
            size,
        )
    left_out = {
        (trained, evaluated): count_left_out(datasets[trained], (TRAIN, VAL))
        + count_left_out(datasets[evaluated], (TEST,))
        for trained, evaluated in evaluations
    }
    facts = {"split": by, "shares_views": leaked, **detector_facts(training, imgsz)}
    write_evaluations(evaluations, facts=facts, left_out=left_out, tables_of=tables_of, options=options)


def write_evaluations(
    evaluations: Mapping[Sides, DomainEvaluation],
    *,
    facts: Mapping[str, Any],
    left_out: Mapping[Sides, int],
    tables_of: Mapping[str, Path],
    options: ComparisonOptions,
) -> None:
    """Write the tables of `evaluate` that are in `tables_of`.

    Parameters
    ----------
    facts
        Values of the columns of `DETECTION_COLUMNS` on split and training, equal for all detectors.
    left_out
        Number of corrupt images of training and test.
    """
    evaluations = dict(sorted(evaluations.items()))
    parts: dict[str, list[pd.DataFrame]] = {"breakdown": [], "curves": [], "false_positives": [], "instances": []}
    for sides, evaluation in track(list(evaluations.items()), "evaluate"):
        for name, table in _tables_of_domain(evaluation).items():
            parts[name].append(_named(table, SIDE_COLUMNS, sides))
    matched = _joined(parts["breakdown"], (*SIDE_COLUMNS, *BREAKDOWN_COLUMNS))
    performances = {sides: evaluation.performance for sides, evaluation in evaluations.items()}
    common = sorted(set.intersection(*(set(evaluation.keys) for evaluation in evaluations.values())))
    of_common = {sides: replace(evaluation, keys=common) for sides, evaluation in evaluations.items()}
    made = {
        "breakdown": matched,
        "detection": _detection_table(matched, left_out, {**facts, "unit": options.resampled}),
        "curves": _joined(parts["curves"], CURVES.columns),
        "false_positives": _joined(parts["false_positives"], (*SIDE_COLUMNS, *FALSE_POSITIVE_COLUMNS)),
        "ipd": _ipd_table(performances, options),
        "rocks": _rock_table(performances),
        "differences": paired_differences(of_common) if common else pd.DataFrame(columns=list(DIFFERENCE_COLUMNS)),
        "instances": _joined(parts["instances"], INSTANCES.columns),
    }
    for name, path in tables_of.items():
        _write(path, made[name])


def detector_facts(training: TrainingOptions, imgsz: int) -> dict[str, Any]:
    """Return the training parameters of a detector by table column."""
    return {
        "detector": detector_name(training.model),
        "start": training.start,
        "epochs": training.epochs,
        "imgsz": imgsz,
    }


def gather_tables(
    *, parts: Mapping[str, Sequence[Path]], gathered: Mapping[str, Path], splits: Sequence[str], seeds: Sequence[int]
) -> None:
    """Concatenate the parts of each table, one for each split and training seed, and add columns `split` and `seed`."""
    for name, path in gathered.items():
        joined: list[pd.DataFrame] = []
        for file, split, seed in zip(parts[name], splits, seeds, strict=True):
            part = tables.read_parquet(file)
            if "split" not in part.columns:
                part.insert(0, "split", pd.Series([split] * len(part), dtype="str"))
            part.insert(list(part.columns).index("split") + 1, "seed", seed)
            if joined and list(part.columns) != list(joined[0].columns):
                raise DetectError(f"other columns than in {parts[name][0]}; evaluate again with one version", path=file)
            joined.append(part)
        tables.write_parquet(path, pd.concat(joined, ignore_index=True))


def _tables_of_domain(evaluation: DomainEvaluation) -> dict[str, pd.DataFrame]:
    photos, options = (evaluation.keys, evaluation.labels, evaluation.predictions), evaluation.options
    matched = match_predictions(*photos, evaluation.performance, options.resampled)
    wrong = false_positives(
        *photos,
        size=evaluation.size,
        confidence=options.iou_confidence,
        unit=options.resampled,
        resamples=options.resamples,
    )
    return {
        "instances": evaluation.performance,
        "breakdown": breakdown(matched, resamples=options.resamples),
        "curves": curves(matched),
        "false_positives": wrong,
    }


def read_evaluation_labels(path: Path, size: tuple[int, int]) -> pd.DataFrame:
    """Read the labels for the evaluation of detectors."""
    return clip_labels(tables.read_parquet(path, tables.LABEL_COLUMNS), size)


def clip_labels(labels: pd.DataFrame, size: tuple[int, int]) -> pd.DataFrame:
    """Clip labels at the border of photos of a size, px, as in the data set; drop labels outside the photo."""
    corners = boxes.clip(labels[list(BOX_COLUMNS)].to_numpy(float), *size)
    clipped = labels.assign(**dict(zip(BOX_COLUMNS, corners.T, strict=True)))
    return clipped[boxes.area(corners) > 0]


def _detection_table(matched: pd.DataFrame, left_out: Mapping[Sides, int], facts: Mapping[str, Any]) -> pd.DataFrame:
    """Return `DETECTION_COLUMNS` over all photos."""
    table = matched[matched["by"] == ALL].assign(**facts)
    table["left_out"] = [left_out[sides] for sides in zip(table["trained"], table["evaluated"], strict=True)]
    return table[list(DETECTION_COLUMNS)]


def _pairs_of_domains(
    performances: Mapping[Sides, pd.DataFrame],
) -> Iterator[tuple[tuple[str, str, str], pd.DataFrame, pd.DataFrame]]:
    """Yield each detector and pair of domains with the instance performances of both domains."""
    for trained in sorted({trained for trained, _ in performances}):
        domains = sorted(evaluated for detector, evaluated in performances if detector == trained)
        for first, second in combinations(domains, 2):
            yield (trained, first, second), performances[trained, first], performances[trained, second]


def _ipd_table(performances: Mapping[Sides, pd.DataFrame], options: ComparisonOptions) -> pd.DataFrame:
    rules = IpdRules(unit=options.resampled)
    rows = []
    for names, *sides in _pairs_of_domains(performances):
        for kind in BOX_CLASSES:
            of_kind = (side[side["kind"] == kind] for side in sides)
            difference = instance_performance_difference(*of_kind, rules=rules, resamples=options.resamples)
            row = dict(zip(IPD_PAIR_COLUMNS, names, strict=True)) | asdict(rules) | asdict(difference)
            rows.append(row | {"kind": kind, "confidence": options.iou_confidence})
    return pd.DataFrame(rows, columns=list(IPD_COLUMNS))


def _rock_table(performances: Mapping[Sides, pd.DataFrame]) -> pd.DataFrame:
    parts = [
        _named(rock_means(pair_rock_labels(first, second)), IPD_PAIR_COLUMNS, names)
        for names, first, second in _pairs_of_domains(performances)
    ]
    return _joined(parts, (*IPD_PAIR_COLUMNS, *ROCK_COLUMNS))


def _named(table: pd.DataFrame, columns: Sequence[str], names: Sequence[str]) -> pd.DataFrame:
    return table.assign(**dict(zip(columns, names, strict=True)))


def _joined(parts: Sequence[pd.DataFrame], columns: Sequence[str]) -> pd.DataFrame:
    filled = [part for part in parts if len(part)] or list(parts[:1])
    return pd.concat(filled, ignore_index=True)[list(columns)] if filled else pd.DataFrame(columns=list(columns))


def _write(path: Path, table: pd.DataFrame) -> None:
    tables.write_parquet(path, table.round(6).reset_index(drop=True))

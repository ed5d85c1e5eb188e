"""Detectors of cover photos and of their twins, evaluated on both, with all folds pooled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from polarsim.detect.dataset import dataset_images
from polarsim.detect.domain_evaluation import DomainEvaluation
from polarsim.detect.evaluate import detector_facts, read_evaluation_labels, write_evaluations
from polarsim.detect.ipd import instance_performance, pair_rock_labels
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.split import TERRAIN, TEST
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.photo import NO_ROCK
from polarsim.schemas.covers import PHOTO_IPD
from polarsim.schemas.detect import PREDICTIONS

_ROCK = ["key", "kind", "rock"]
Sides = tuple[str, str]  # training domain and evaluated domain of a detector


def compare_domains(
    *,
    predictions: Sequence[Path],
    labels: Mapping[str, Path],
    datasets: Sequence[Path],
    photo_domain: str,
    tables_of: Mapping[str, Path],
    photos: Path,
    size: tuple[int, int],
    options: ComparisonOptions,
    training: TrainingOptions,
    start: str,
    imgsz: int,
) -> None:
    """Write the metrics of all pairs of domains over the photos of all folds.

    Each photo is evaluated with the detector of the fold that excludes its terrain from training.

    Parameters
    ----------
    predictions : sequence of Path
        Files named `<trained>_on_<evaluated>.parquet` of every fold.
    labels : mapping of str to Path
        Label table of each domain.
    datasets : sequence of Path
        Data set of each fold, of any domain: the test part has the same photos in all domains.
    tables_of : mapping of str to Path
        Tables to write, by a name of `detect.evaluate`.
    photos : Path
        Table to write: the IPD of each photo between `photo_domain` and each domain of twins.
    size : (int, int)
        Width and height of the photos, px.
    training, imgsz
        Training options of the detectors and longer side of their input, px, for the tables.
    start : str
        Name of the initial weights in the tables.
    """
    keys = sorted(key for dataset in datasets for key in dataset_images(dataset, TEST))
    truth = {domain: read_evaluation_labels(path, size) for domain, path in labels.items()}
    evaluations = {
        sides: DomainEvaluation(keys, truth[sides[1]], table, options, size)
        for sides, table in pool_folds(predictions).items()
    }
    facts = {"split": TERRAIN, "shares_views": False, **detector_facts(training, imgsz), "start": start}
    left_out = dict.fromkeys(evaluations, 0)
    write_evaluations(evaluations, facts=facts, left_out=left_out, tables_of=tables_of, options=options)
    tables.write_parquet(photos, ipd_by_photo(evaluations, photo_domain).round(6))


def pool_folds(predictions: Sequence[Path]) -> dict[Sides, pd.DataFrame]:
    """Return the predictions of each detector on each domain over all folds, by (trained, evaluated).

    A photo with predictions of two folds is an error.
    """
    by_sides: dict[Sides, pd.DataFrame] = {}
    for path in predictions:
        trained, _, evaluated = path.stem.partition("_on_")
        table = tables.read_parquet(path, PREDICTIONS.columns)
        others = by_sides.get((trained, evaluated))
        if others is not None:
            if repeated := sorted(set(table["key"]) & set(others["key"])):
                raise DetectError(f"{repeated[0]} is a test photo of two folds, expected one", path=path)
            table = pd.concat([others, table], ignore_index=True)
        by_sides[trained, evaluated] = table
    return dict(sorted(by_sides.items()))


def ipd_by_photo(evaluations: Mapping[Sides, DomainEvaluation], photo_domain: str) -> pd.DataFrame:
    """Return `PHOTO_IPD` without the seed: a row per detector, domain of twins, photo and kind with pairs."""
    rows = []
    for (trained, twin), evaluation in evaluations.items():
        if twin == photo_domain:
            continue
        photo = evaluations[trained, photo_domain]
        pairs = pair_rock_labels(photo.performance, evaluation.performance)
        pairs["difference"] = pairs["first"] - pairs["second"]
        pairs["absolute"] = pairs["difference"].abs()
        pairs = pairs.merge(rendered_performance(photo, evaluation), on=_ROCK, how="left", validate="one_to_one")
        for (key, kind), part in pairs.groupby(["key", "kind"]):
            means = part[["first", "second", "difference", "absolute", "label_iou"]].mean()
            rows.append((trained, twin, key, kind, len(part), *means))
    columns = PHOTO_IPD.without("split", "seed")
    return pd.DataFrame(rows, columns=list(columns)).astype({name: PHOTO_IPD.dtypes[name] for name in columns})


def rendered_performance(photo: DomainEvaluation, twin: DomainEvaluation) -> pd.DataFrame:
    """Return the performance in the photos of a detector that predicts the rendered boxes: key, kind, rock, label_iou.

    If a rock has several labels in a photo, the maximum is used, as in the IPD.
    """
    known = photo.labels[photo.labels["rock"] != NO_ROCK]
    performance = instance_performance(known, twin.labels.assign(confidence=1.0), confidence=1.0)
    return performance.groupby(_ROCK)["iou"].max().rename("label_iou").reset_index()

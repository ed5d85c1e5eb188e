"""Ablation: change of the gap between photos and twins after replacing a component of the twin.

The same detectors, without further training, are evaluated on photos, twins and modified twins of equal keys. Changes
are paired by rock and by bootstrap replicate, so an interval refers to the change, not to two separate metrics.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.detect.dataset import dataset_images
from polarsim.detect.domain_evaluation import DomainEvaluation, ipd_change, paired_change
from polarsim.detect.evaluate import detector_facts, read_evaluation_labels
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.predict import PREDICTION_COLUMNS
from polarsim.detect.split import TEST
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.progress import track
from polarsim.schemas.detect import ABLATION

ABLATION_COLUMNS = ABLATION.without("split", "seed")


def effect_of(photo: DomainEvaluation, twin: DomainEvaluation, replaced: DomainEvaluation) -> pd.DataFrame:
    """Return the effect of a component on a detector: a row per class; the evaluations have equal keys and options."""
    units = photo.draws[1].shape[1]
    rows = []
    for kind in BOX_CLASSES:
        facts = {"kind": kind, "images": len(photo.keys), "units": units, "unit": photo.options.resampled}
        row: dict[str, object] = {**facts, **ipd_change(kind, photo, twin, replaced)}
        row["map50_photo"] = float(photo.precision[kind][0])
        row |= paired_change("map50", twin.precision[kind], replaced.precision[kind], units)
        for name, column in (
            (("false_positives", "false_positives"), ("false_positive_area", "area")) if kind == ROCK else ()
        ):
            row[f"{name}_photo"] = float(photo.rates(column)[0])
            row |= paired_change(name, twin.rates(column), replaced.rates(column), units)
        rows.append(row)
    return pd.DataFrame(rows, columns=["kind", *ABLATION_COLUMNS[ABLATION_COLUMNS.index("images") :]])


def write_ablation(
    *,
    predictions: Mapping[tuple[str, str], Path],
    labels: Mapping[str, Path],
    datasets: Mapping[str, Path],
    photo: str,
    twin: str,
    replaced: Mapping[str, str],
    ablation: Path,
    size: tuple[int, int],
    options: ComparisonOptions,
    training: TrainingOptions,
    imgsz: int,
) -> None:
    """Write `ABLATION_COLUMNS`, a row per component, detector and class.

    Parameters
    ----------
    predictions
        Prediction tables by training domain and evaluated domain: photos, twin, or a component.
    labels, datasets
        Label table and data set of each evaluated domain. Only photos in the test part of all data sets are used.
    photo, twin
        Domains of the photos and of the unmodified twin.
    replaced
        Text description of each component, in the order of the ablation.
    size
        Width and height of the photos, px.
    """
    keys = sorted(set.intersection(*(set(dataset_images(dataset, TEST)) for dataset in datasets.values())))
    if not keys:
        raise DetectError("the domains of the ablation have no common test image", path=datasets[photo])
    truth = {domain: read_evaluation_labels(path, size) for domain, path in labels.items()}
    facts = {"model": twin, **detector_facts(training, imgsz)}
    parts = []
    for trained in track(sorted({trained for trained, _ in predictions}), "ablation"):
        evaluations = {
            domain: DomainEvaluation(keys, truth[domain], tables.read_parquet(path, PREDICTION_COLUMNS), options, size)
            for (detector, domain), path in predictions.items()
            if detector == trained
        }
        for component, words in replaced.items():
            rows = effect_of(evaluations[photo], evaluations[twin], evaluations[component])
            parts.append(rows.assign(component=component, replaced=words, trained=trained, **facts))
    table = pd.concat(parts, ignore_index=True)[list(ABLATION_COLUMNS)]
    tables.write_parquet(ablation, table.round(6))

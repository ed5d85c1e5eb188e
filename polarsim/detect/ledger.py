"""The gap ledger: what changes of the gap between photos and twins when one ingredient of the twin is replaced.

Photos, twin and the twin with the ingredient replaced are evaluated by the same detectors, which are not trained
again, on
the same photos. What changes is paired: the same rocks, and the same resamples of views for both twins, so an interval
is that of the change and not of two figures beside each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.detect.dataset import read_pictures
from polarsim.detect.evaluate import detector_facts, read_labels
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.detect.predict import PREDICTION_COLUMNS
from polarsim.detect.seen import Seen, change, ipd_change
from polarsim.detect.split import TEST
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.formats.gap_ledger import FIGURE_COLUMNS
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.progress import track

LEDGER_COLUMNS = (
    "ingredient", "replaced", "model", "trained", "kind", "detector", "epochs", "imgsz", "images", "units", "unit",
    "pairs", "iou_photo", "iou_twin", "iou", "map50_photo", "alarms_photo", "alarm_area_photo", *FIGURE_COLUMNS,
)  # fmt: skip
_DIGITS = 6


def weigh(photo: Seen, twin: Seen, replaced: Seen) -> pd.DataFrame:
    """What one detector says of one ingredient: from `images` on the columns of `LEDGER_COLUMNS`, a row a class.

    The three have the same keys and options.
    """
    units = photo.draws[1].shape[1]
    rows = []
    for kind in BOX_CLASSES:
        facts = {"kind": kind, "images": len(photo.keys), "units": units, "unit": photo.options.resampled}
        row: dict[str, object] = {**facts, **ipd_change(kind, photo, twin, replaced)}
        row |= {"map50_photo": float(photo.precision[kind][0])}
        row |= change("map50", twin.precision[kind], replaced.precision[kind], units)
        for name, column in (("alarms", "alarms"), ("alarm_area", "area")) if kind == ROCK else ():
            row |= {f"{name}_photo": float(photo.rates(column)[0])}
            row |= change(name, twin.rates(column), replaced.rates(column), units)
        rows.append(row)
    columns = LEDGER_COLUMNS[LEDGER_COLUMNS.index("images") :]
    return pd.DataFrame(rows, columns=["kind", *columns])


def write_ledger(
    *,
    predictions: Mapping[tuple[str, str], Path],
    labels: Mapping[str, Path],
    datasets: Mapping[str, Path],
    photo: str,
    twin: str,
    replaced: Mapping[str, str],
    ledger: Path,
    options: ComparisonOptions,
    training: TrainingOptions,
    imgsz: int,
) -> None:
    """Write `LEDGER_COLUMNS`, a row an ingredient, detector and class.

    Parameters
    ----------
    predictions
        By what a detector was trained on, and the domain that it saw: photos, twin, or an ingredient.
    labels, datasets
        Label table and data set of each of these domains. Photos count that all data sets have in their test part.
    photo, twin
        The domains of the photos and of the twin as the run has it.
    replaced
        What each ingredient replaces, in words; in the order of the ledger.
    training, imgsz
        How the detectors were trained and the longer side of their pictures, px, as the ledger names it.

    Raises
    ------
    PolarsimError
        A broken file, or no photo in all domains.
    """
    keys = sorted(set.intersection(*(set(read_pictures(dataset, TEST)) for dataset in datasets.values())))
    if not keys:
        raise DetectError("no test picture that every twin of the ledger has", path=datasets[photo])
    truth = {domain: read_labels(path) for domain, path in labels.items()}
    facts = {"model": twin, **detector_facts(training, imgsz)}
    parts = []
    for trained in track(sorted({trained for trained, _ in predictions}), "gap ledger"):
        seen = {
            domain: Seen(keys, truth[domain], tables.read_parquet(path, PREDICTION_COLUMNS), options)
            for (detector, domain), path in predictions.items()
            if detector == trained
        }
        for ingredient, words in replaced.items():
            rows = weigh(seen[photo], seen[twin], seen[ingredient])
            parts.append(rows.assign(ingredient=ingredient, replaced=words, trained=trained, **facts))
    table = pd.concat(parts, ignore_index=True)[list(LEDGER_COLUMNS)]
    tables.write_parquet(ledger, table.round(_DIGITS))

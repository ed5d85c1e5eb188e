"""How well propagated labels agree with hand-annotated or true ones, by how far a label had to be propagated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats import release
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet, write_parquet
from polarsim.photo import BOX_CLASSES, SHADOW, PhotoKey
from polarsim.scoring.label_pairs import labels_by_photo, pair_labels, shadows_annotated
from polarsim.scoring.metrics import BOX_METRICS, Against, Metric, write_metrics
from polarsim.scoring.options import ScoringOptions
from polarsim.scoring.reliability import ANY_SOURCE, brier_score, calibration_error, reliability_table
from polarsim.scoring.score import Counts, Labels, box_reader, count_photo, read_sound

EXPOSURES, LIGHT, CAMERA = "other exposures", "light on", "Left to Right"
AZIMUTH, NO_SUN, POSITION, ALL = "another azimuth", "no Sun", "position without seed", "all but seeds"
TASKS = (EXPOSURES, LIGHT, CAMERA, AZIMUTH, NO_SUN, POSITION, ALL)
ANNOTATED = "shadow, where annotated"  # photos whose truth has a shadow: at short exposures nobody draws any


def score_labels(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    table: Path,
    truth: Path,
    seeds: Path,
    evaluation: Path,
    pairs: Path,
    options: ScoringOptions,
) -> None:
    """Write the evaluation of a terrain's labels, and every true box beside its label.

    Parameters
    ----------
    keys
        The photos that were labelled.
    table
        The terrain's label table; a photo without row has nothing to see.
    truth
        Folder of hand-annotated KEY.txt files (a terrain's, or a release's root), or the analog's labels.parquet.
    seeds
        Folder of the terrain's seeds; these photos themselves are not scored.
    """
    labels = read_parquet(table, LABEL_COLUMNS)
    found = dict.fromkeys(keys, Labels.none()) | labels_by_photo(labels)
    wanted = read_truth(truth, terrain, found, options)
    seed_keys = set(release.key_files(seeds).files)
    tasks = {key: task_of(key, seed_keys) for key in wanted}
    metrics = [Metric("seeds", "photos_annotated", len(seed_keys), "photos", len(found), "own")]
    metrics += score_tasks(wanted, found, tasks, TASKS, against(truth), options)
    unlabelled = len([key for key, task in tasks.items() if task is not None and key not in found])
    metrics.append(Metric("photos with truth", "without_label_file", unlabelled, "photos", len(wanted), against(truth)))
    compared = {key: true for key, true in wanted.items() if key in found}
    paired = pair_labels(compared, labels, tasks, against(truth), options)
    write_parquet(pairs, paired)
    write_metrics(evaluation, "labels", terrain, metrics + confidence_metrics(paired, against(truth)))


def task_of(key: PhotoKey, seeds: Iterable[PhotoKey]) -> str | None:
    """What it took to label a photo, given the seeds; None for a seed itself.

    A photo counts for the hardest step that it needs: no Sun, then another azimuth, Left to Right, light on.
    """
    near = [seed for seed in seeds if seed.station == key.station]
    if key in near:
        return None
    if not near:
        return POSITION
    if key.azimuth == "no" and all(seed.azimuth != "no" for seed in near):
        return NO_SUN
    near = [seed for seed in near if seed.azimuth == key.azimuth]
    if not near:
        return AZIMUTH
    if all(seed.camera != key.camera for seed in near):
        return CAMERA
    return LIGHT if all(seed.light != key.light for seed in near) else EXPOSURES


def score_tasks(
    wanted: Mapping[PhotoKey, Labels],
    found: Mapping[PhotoKey, Labels],
    tasks: Mapping[PhotoKey, str | None],
    order: Iterable[str],
    against: Against,
    options: ScoringOptions,
) -> list[Metric]:
    """Precision, recall, F1 and mIoU by kind and task, pooled over the photos that are in both."""
    total: dict[tuple[str, str], Counts] = {}
    for key in sorted(set(wanted) & set(found)):
        task = tasks[key]
        if task is None:
            continue
        for kind, counts in count_photo(wanted[key], found[key], options.iou_threshold).items():
            annotated = kind == SHADOW and shadows_annotated(key, counts.tp + counts.fn, against)
            for name in [kind, ANNOTATED] if annotated else [kind]:
                for part in (task, ALL):
                    total[name, part] = total.get((name, part), Counts()) + counts
    metrics = []
    for kind in (*BOX_CLASSES, ANNOTATED):
        for task in order:
            if (kind, task) in total:
                metrics += box_metrics(f"{kind}: {task}", total[kind, task], against)
    return metrics


def read_folder(folder: Path, terrain: int) -> dict[PhotoKey, Labels]:
    """The labels of a terrain's folder of KEY.txt; broken lines are errors."""
    files, read = release.key_files(folder).files, box_reader()
    return {key: read(path) for key, path in files.items() if key.terrain == terrain}


def read_truth(
    truth: Path, terrain: int, labelled: Iterable[PhotoKey], options: ScoringOptions
) -> dict[PhotoKey, Labels]:
    """True labels by photo: hand-annotated files as they are, or the analog's table.

    A photo without hand-annotated file has no truth: nobody looked. The analog knows all: without row, without object.
    """
    if not truth.is_file():
        folder = release.label_folder(truth, terrain) if (truth / release.BOXES).is_dir() else truth
        return read_sound_boxes(folder, terrain)
    table = read_parquet(truth, LABEL_COLUMNS)
    found = labels_by_photo(visible(table[table["terrain"] == terrain], options))
    return {key: found.get(key, Labels.none()) for key in sorted({*found, *labelled})}


def visible(truth: pd.DataFrame, options: ScoringOptions) -> pd.DataFrame:
    """The true labels that a person could have annotated: large enough, and clear in some exposure of their bracket.

    People copy labels over all exposures of an exposure bracket, so one that shows the object is enough. A shadow must
    be a shadow's width somewhere, too: a line of dark pixels around a rock's foot has a box as large as the rock, and
    nobody draws it. The columns `visible_px`, `width_px` and `contrast` (DN) may be missing.
    """
    if "visible_px" in truth.columns:
        truth = truth[truth["visible_px"] >= options.min_visible_px]
    if "width_px" in truth.columns:
        truth = truth[(truth["kind"] != SHADOW) | (truth["width_px"] >= options.min_shadow_width_px)]
    if "contrast" in truth.columns:
        one_object = ["terrain", "position", "light", "azimuth", "camera", "kind", "rock"]
        clearest = truth["contrast"].abs().groupby([truth[name] for name in one_object]).transform("max")
        truth = truth[clearest >= options.min_contrast_dn]
    return truth


def read_sound_boxes(folder: Path, terrain: int) -> dict[PhotoKey, Labels]:
    """As `read_folder`, but a broken file is left out with a warning: the release has one, nobody's result."""
    files = release.key_files(folder).files
    return read_sound({key: path for key, path in files.items() if key.terrain == terrain}, box_reader())[0]


def against(truth: Path) -> Against:
    """What a truth is called: the analog's table is truth, annotated files are labels."""
    return "truth" if truth.is_file() else "labels"


def confidence_metrics(pairs: pd.DataFrame, against: Against) -> list[Metric]:
    """How far the confidence of labels is from the share of them that are right, by kind."""
    table = reliability_table(pairs)
    metrics = []
    for kind in BOX_CLASSES:
        bins = table[(table["kind"] == kind) & (table["label_source"] == ANY_SOURCE)]
        if len(bins):
            n = round(bins["labels"].sum())
            for name, value in (("ece", calibration_error(bins)), ("brier", brier_score(bins))):
                metrics.append(Metric(f"{kind}: confidence", name, value, "1", n, against))
    return metrics


def box_metrics(subject: str, counts: Counts, against: Against) -> list[Metric]:
    """Precision, recall, F1 and mean IoU; NaN where there is nothing to divide by."""
    sizes = dict.fromkeys(BOX_METRICS, counts.tp + counts.fn) | {"precision": counts.tp + counts.fp}
    values = {name: float("nan") if value is None else float(value) for name, value in counts.metrics().items()}
    return [Metric(subject, name, values[name], "1", n, against) for name, n in sizes.items()]

"""Evaluation of twins: rendered boxes against annotations or ground truth, and pixels against photos."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import write_parquet
from polarsim.photo import Terrain
from polarsim.run_files.fitted_photos import read_fits
from polarsim.run_files.pictures import pictures_at
from polarsim.scoring.labels import ALL, against, read_folder, read_true_labels, score_tasks
from polarsim.scoring.metrics import Metric, summary_metric, write_metrics
from polarsim.scoring.twin_photos import compare_twins, photos_to_compare, subject_of
from polarsim.site import Site

_METRICS = {  # of the evaluation, and their units
    "log2_twin_over_photo": "stops", "log2_difference": "stops", "psnr_db": "dB", "ssim": "1", "correlation": "1",
}  # fmt: skip


def score_twins(
    *,
    site: Site,
    terrain: Terrain,
    boxes: Path,
    truth: Path | None,
    twins: Mapping[str, Path],
    others: Mapping[str, Path],
    materials: Path | None,
    light: Path | None,
    meshes: Path,
    photos: Path,
    covers: Path | None,
    drawn: Path | None,
    instances: Path,
    evaluation: Path,
    appearance: Path,
) -> None:
    """Write the evaluation of the twins of a terrain, and the table of the appearance of each twin next to its photo.

    Parameters
    ----------
    boxes : Path
        Folder of rendered boxes, `KEY.txt`.
    truth : Path, optional
        Folder of annotated `KEY.txt` files, or `labels.parquet` of the analog.
    twins, others : mapping of model to Path
        Folders of `KEY.png` of the terrain, and of another terrain for the control; `others` may be empty.
    materials, light : Path, optional
        Folder of materials and file of light fields, fitted to photos.
    meshes : Path
        Folder of the meshes of the terrain, whose ground may have been refined by photos.
    photos : Path
        Table `photos.parquet`, may be empty.
    covers, drawn : Path, optional
        Folders of published cover photos, which replace the photos, and of the masks of lines drawn into them.
    instances : Path
        Folder of the instance maps of the twins.
    """
    metrics: list[Metric] = []
    if truth is not None:
        rendered = read_folder(boxes, terrain, site.images.size)
        true = read_true_labels(truth, terrain, rendered, site.images.size)
        tasks = {key: f"camera {key.camera}" for key in true}
        order = ("camera L", "camera R", ALL)
        for metric in score_tasks(true, rendered, tasks, order, against(truth), site.usual_exposure_ms):
            subject = "rendered " + metric.subject.replace(ALL, "all")  # rendered boxes do not depend on seeds
            metrics.append(replace(metric, subject=subject))
    pairs = compare_twins(
        photos_to_compare(terrain, photos, covers, drawn, instances, site.usual_exposure_ms),
        {model: pictures_at(folder) for model, folder in twins.items()},
        {model: pictures_at(folder) for model, folder in others.items()},
        read_fits(twins, materials, light, meshes),
    )
    write_metrics(evaluation, "render", terrain, metrics + similarity_metrics(pairs))
    write_parquet(appearance, pairs)


def similarity_metrics(pairs: pd.DataFrame) -> list[Metric]:
    """Return the medians over the photos of each model and relation to the fits."""
    return [
        metric
        for (model, relation), rows in pairs.groupby(["model", "relation"])
        for name, unit in _METRICS.items()
        for metric in summary_metric(
            subject_of(str(model), str(relation)), name, rows[name].to_numpy(), unit, "photos", p90=False
        )
    ]

"""Tables of images, labels, predictions and rocks for the page."""

from __future__ import annotations

import numpy as np
import pandas as pd

from polarsim.detect.evaluate import clip_labels
from polarsim.detect.false_positives import mark_false_positives
from polarsim.formats.tables import key_columns
from polarsim.geometry.boxes import iou
from polarsim.geometry.matching_numba import match_predictions_of_photo
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, PhotoKey, Terrain, terrain_text
from polarsim.run_files.run import PHOTO, Run
from polarsim.schemas.photos import BOX

EDGES = list(BOX.each)
MIN_CONFIDENCE = 0.05  # of shown predictions
MIN_IOU = 0.5  # of a correct prediction
STATES = ("missing", "corrupt", "dark")  # states of images in the detect stage, worst first


def picture_table(run: Run) -> pd.DataFrame:
    """Return a row per photo or twin: key and fields of the key, domain, score, confidence, counts, defect.

    `score` is the mean IoU of a photo's labels with true boxes, or the structural similarity of a twin with the photo;
    NaN if not available. `defect` is empty for images without known defect.
    """
    rows = [{**key_columns(key), "domain": domain} for domain, key in run.pictures]
    table = pd.DataFrame(rows, columns=[*key_columns(PhotoKey(1, "A", "off", "30", "L", 16)), "domain"])
    counts = pd.concat([_counts(run, of_twins=False), _counts(run, of_twins=True)])
    table["of_twins"] = table["domain"] != PHOTO
    table = table.merge(counts, on=["key", "of_twins"], how="left").drop(columns="of_twins")
    table = table.merge(_scores(run), on=["key", "domain"], how="left")
    table["defect"] = _defects(run, table)
    for name in ("rocks", "shadows"):
        table[name] = table[name].fillna(0).astype(np.int64)
    return table


def _counts(run: Run, *, of_twins: bool) -> pd.DataFrame:
    """Return the number of labels of each photo and their mean and minimum confidence."""
    labels = run.all_labels(of_twins=of_twins)
    grouped = labels.assign(rocks=labels["kind"] == ROCK, shadows=labels["kind"] != ROCK).groupby("key")
    counts = grouped[["rocks", "shadows"]].sum()
    confidence = grouped["confidence"].agg(confidence="mean", min_confidence="min")
    return counts.join(confidence).reset_index().assign(of_twins=of_twins)


def _scores(run: Run) -> pd.DataFrame:
    parts = []
    for terrain in run.terrains:
        pairs = run.table(f"evaluation/label_pairs_Terrain{terrain_text(terrain)}.parquet")
        if pairs is not None:
            mean = pairs.dropna(subset=["iou_best"]).groupby("key")["iou_best"].mean()
            parts.append(mean.rename("score").reset_index().assign(domain=PHOTO))
        twins = run.table(f"evaluation/appearance_Terrain{terrain_text(terrain)}.parquet")
        if twins is not None:
            parts.append(twins.rename(columns={"model": "domain", "ssim": "score"})[["key", "domain", "score"]])
    scores = pd.concat(parts) if parts else pd.DataFrame(columns=["key", "domain", "score"])
    return scores.drop_duplicates(["key", "domain"]).astype({"score": float})


def _defects(run: Run, table: pd.DataFrame) -> pd.Series:
    """Return the defect of each image: states of the detect stage, otherwise defects of label files."""
    defects: dict[tuple[str, str], str] = {}
    listed = run.table("tables/defects.csv")
    for row in [] if listed is None else listed[listed["severity"] != "note"].to_dict("records"):
        defects.setdefault((PHOTO, str(row["file"]).rpartition("/")[2].partition(".")[0]), str(row["name"]))
    for path in sorted((run.folder / "detect" / "pictures").glob("*/pictures.csv")):
        pictures = run.table(str(path.relative_to(run.folder)))
        assert pictures is not None
        domain = run.domain_of(path.parent.name)
        bad = pictures[pictures["state"].isin(STATES)]
        defects.update(((domain, str(key)), str(state)) for key, state in zip(bad["key"], bad["state"], strict=True))
    return pd.Series([defects.get(pair, "") for pair in zip(table["domain"], table["key"], strict=True)], dtype=str)


def shown_labels(run: Run, terrain: Terrain, *, of_twins: bool) -> pd.DataFrame:
    """Return the labels of a terrain sorted by photo: key, kind, rock, source, confidence and box."""
    labels = run.labels(terrain, of_twins=of_twins)
    return labels[["key", "kind", "rock", "source", "confidence", *EDGES]].sort_values("key", kind="stable")


def shown_predictions(run: Run, name: str) -> pd.DataFrame:
    """Return the predictions of a detector sorted by photo and confidence.

    Columns: key, kind, confidence, box, iou, rock, right, false_positive. `iou` and `rock` are of the label of the same
    kind with the largest IoU. `right`: matched to a label by COCO's matching at IoU 0.5 (`polarsim.detect.metrics`).
    `false_positive`: counted in `tables/false_positives` (rocks only).
    """
    domain = run.domain_of(name.rpartition("_on_")[2])
    predicted = run.predicted(name)
    predicted = predicted[predicted["confidence"] >= MIN_CONFIDENCE].sort_values(
        ["key", "confidence"], ascending=[True, False], kind="stable", ignore_index=True
    )
    size = run.site.images.size
    labels = clip_labels(run.all_labels(of_twins=domain != PHOTO), size)
    by_photo = labels.groupby(["key", "kind"]).indices
    boxes, rocks = labels[EDGES].to_numpy(float), labels["rock"].to_numpy()
    count = len(predicted)
    overlap, rock, correct = np.zeros(count), np.full(count, NO_ROCK), np.zeros(count, bool)
    corners = predicted[EDGES].to_numpy(float)
    for pair, rows in predicted.groupby(["key", "kind"]).indices.items():
        label_rows = by_photo.get(pair)
        if label_rows is None:
            continue
        ious = iou(corners[rows], boxes[label_rows])
        overlap[rows] = ious.max(axis=1)
        rock[rows] = np.where(overlap[rows] > 0, rocks[label_rows][ious.argmax(axis=1)], NO_ROCK)
        matched, _ = match_predictions_of_photo(ious, np.array([MIN_IOU]), np.zeros((1, len(label_rows)), bool))
        correct[rows] = matched[0, 0]
    false_positive = mark_false_positives(labels, predicted, size)["false_positive"]
    return predicted.assign(iou=overlap, rock=rock, right=correct, false_positive=false_positive)


def facts_of_rocks(run: Run, terrain: Terrain) -> pd.DataFrame:
    """Return a row per rock of a terrain: position, size, metrics of the mesh, IoU difference between domains."""
    rocks = run.table(f"rocks/Terrain{terrain_text(terrain)}/rocks.parquet")
    if rocks is None:
        return pd.DataFrame({"rock": pd.Series(dtype=np.int64)})
    meshes = run.table(f"evaluation/meshes_Terrain{terrain_text(terrain)}.csv")
    if meshes is not None and "rock" in meshes:
        full = meshes[~meshes["mesh"].str.contains("decimate")].drop(columns=["terrain", "mesh"], errors="ignore")
        rocks = rocks.merge(full, on="rock", how="left")
    ipd_rocks = run.table("detect/rocks.parquet")
    if ipd_rocks is not None:
        of_terrain = ipd_rocks[(ipd_rocks["terrain"] == terrain) & (ipd_rocks["kind"] == ROCK)]
        rocks = rocks.merge(
            of_terrain.groupby("rock")["difference"].mean().rename("iou_difference"), on="rock", how="left"
        )
    return rocks


assert BOX_CLASSES[0] == ROCK  # order of kinds in the page

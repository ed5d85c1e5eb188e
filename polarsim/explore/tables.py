"""The columns that the page filters and draws: a row a picture, a row a label, a row a prediction."""

from __future__ import annotations

import numpy as np
import pandas as pd

from polarsim.detect.evaluate import clip_labels
from polarsim.detect.false_positives import mark_false_positives
from polarsim.formats.tables import key_columns
from polarsim.geometry.boxes import iou
from polarsim.geometry.matching_numba import match
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, PhotoKey
from polarsim.run_files.run import PHOTO, Run
from polarsim.schemas.photos import BOX

EDGES = list(BOX.each)
LEAST_CONFIDENCE = 0.05  # of predictions that are shown
RIGHT_IOU = 0.5  # least overlap of a prediction that is right
STATES = ("missing", "corrupt", "dark")  # of pictures, worst first, as the detect stage found them


def picture_table(run: Run) -> pd.DataFrame:
    """A row a photo or twin: key, its parts, domain, score, confidence, least_confidence, rocks, shadows, defect.

    `score` is the mean IoU of a photo's labels with true boxes, where the run knows truth, and of a twin its structural
    similarity with its photo; NaN where neither is known. `defect` is empty where none is known.
    """
    rows = [{**key_columns(key), "domain": domain} for domain, key in run.pictures]
    table = pd.DataFrame(rows, columns=[*key_columns(PhotoKey(1, "A", "off", "30", "L", 16)), "domain"])
    counted = pd.concat([_counts(run, of_twins=False), _counts(run, of_twins=True)])
    table["of_twins"] = table["domain"] != PHOTO
    table = table.merge(counted, on=["key", "of_twins"], how="left").drop(columns="of_twins")
    table = table.merge(_scores(run), on=["key", "domain"], how="left")
    table["defect"] = _defects(run, table)
    for name in ("rocks", "shadows"):
        table[name] = table[name].fillna(0).astype(np.int64)
    return table


def _counts(run: Run, *, of_twins: bool) -> pd.DataFrame:
    """Labels of each photo: how many, and how sure they are."""
    labels = run.all_labels(of_twins=of_twins)
    grouped = labels.assign(rocks=labels["kind"] == ROCK, shadows=labels["kind"] != ROCK).groupby("key")
    counts = grouped[["rocks", "shadows"]].sum()
    sure = grouped["confidence"].agg(confidence="mean", least_confidence="min")
    return counts.join(sure).reset_index().assign(of_twins=of_twins)


def _scores(run: Run) -> pd.DataFrame:
    parts = []
    for terrain in run.terrains:
        pairs = run.table(f"evaluation/label_pairs_Terrain{terrain:02d}.parquet")
        if pairs is not None:
            mean = pairs.dropna(subset=["iou_best"]).groupby("key")["iou_best"].mean()
            parts.append(mean.rename("score").reset_index().assign(domain=PHOTO))
        twins = run.table(f"evaluation/twin_pairs_Terrain{terrain:02d}.parquet")
        if twins is not None:
            parts.append(twins.rename(columns={"model": "domain", "ssim": "score"})[["key", "domain", "score"]])
    known = pd.concat(parts) if parts else pd.DataFrame(columns=["key", "domain", "score"])
    return known.drop_duplicates(["key", "domain"]).astype({"score": float})


def _defects(run: Run, table: pd.DataFrame) -> pd.Series:
    """The worst defect that the run knows of each picture: the detect stage's states, then those of label files."""
    known: dict[tuple[str, str], str] = {}
    listed = run.table("tables/defects.csv")
    for row in [] if listed is None else listed[listed["severity"] != "note"].to_dict("records"):
        known.setdefault((PHOTO, str(row["file"]).rpartition("/")[2].partition(".")[0]), str(row["name"]))
    for path in sorted((run.folder / "detect" / "pictures").glob("*/pictures.csv")):
        pictures = run.table(str(path.relative_to(run.folder)))
        assert pictures is not None
        domain = run.domain_of(path.parent.name)
        bad = pictures[pictures["state"].isin(STATES)]
        known.update(((domain, str(key)), str(state)) for key, state in zip(bad["key"], bad["state"], strict=True))
    return pd.Series([known.get(pair, "") for pair in zip(table["domain"], table["key"], strict=True)], dtype=str)


def shown_labels(run: Run, terrain: int, *, of_twins: bool) -> pd.DataFrame:
    """Labels of a terrain in the order of photos: key, kind, rock, source, confidence and the box."""
    labels = run.labels(terrain, of_twins=of_twins)
    return labels[["key", "kind", "rock", "source", "confidence", *EDGES]].sort_values("key", kind="stable")


def shown_predictions(run: Run, name: str) -> pd.DataFrame:
    """Return the predictions of a detector in the order of photos.

    Columns: key, kind, confidence, the box, iou, rock, right, false_positive. `iou` and `rock` are those of the label
    of its kind that a prediction overlaps most. `right` marks a prediction that COCO's matching gives a label at an IoU
    of 0.5 (`polarsim.detect.metrics`), `false_positive` one that `tables/false_positives` counts: a rock.
    """
    domain = run.domain_of(name.rpartition("_on_")[2])
    found = run.predicted(name)
    found = found[found["confidence"] >= LEAST_CONFIDENCE].sort_values(
        ["key", "confidence"], ascending=[True, False], kind="stable", ignore_index=True
    )
    labels = clip_labels(run.all_labels(of_twins=domain != PHOTO))
    by_photo = labels.groupby(["key", "kind"]).indices
    boxes, rocks = labels[EDGES].to_numpy(float), labels["rock"].to_numpy()
    overlap, rock, right = np.zeros(len(found)), np.full(len(found), NO_ROCK), np.zeros(len(found), bool)
    predicted = found[EDGES].to_numpy(float)
    for pair, rows in found.groupby(["key", "kind"]).indices.items():
        own = by_photo.get(pair)
        if own is None:
            continue
        shared = iou(predicted[rows], boxes[own])
        overlap[rows] = shared.max(axis=1)
        rock[rows] = np.where(overlap[rows] > 0, rocks[own][shared.argmax(axis=1)], NO_ROCK)
        matched, _ = match(shared, np.array([RIGHT_IOU]), np.zeros((1, len(own)), bool))
        right[rows] = matched[0, 0]
    strange = mark_false_positives(labels, found)["false_positive"]
    return found.assign(iou=overlap, rock=rock, right=right, false_positive=strange)


def facts_of_rocks(run: Run, terrain: int) -> pd.DataFrame:
    """What tables say of every rock of a terrain: its position and size, its mesh, how detectors see it."""
    rocks = run.table(f"rocks/Terrain{terrain:02d}/rocks.parquet")
    if rocks is None:
        return pd.DataFrame({"rock": pd.Series(dtype=np.int64)})
    meshes = run.table(f"evaluation/meshes_Terrain{terrain:02d}.csv")
    if meshes is not None and "rock" in meshes:
        own = meshes[~meshes["mesh"].str.contains("decimate")].drop(columns=["terrain", "mesh"], errors="ignore")
        rocks = rocks.merge(own, on="rock", how="left")
    seen = run.table("detect/rocks.parquet")
    if seen is not None:
        own = seen[(seen["terrain"] == terrain) & (seen["kind"] == ROCK)]
        rocks = rocks.merge(own.groupby("rock")["difference"].mean().rename("iou_difference"), on="rock", how="left")
    return rocks


assert BOX_CLASSES[0] == ROCK  # the page numbers kinds in this order

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.formats.tables import label_table, read_csv, read_parquet, write_parquet
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.report.labels_table import SIZES, format_labels, label_scores, size_class, tabulate_labels
from polarsim.scoring.label_pairs import pair_labels
from polarsim.scoring.labels import PROPAGATION_TASKS, score_tasks, task_of
from polarsim.scoring.score import PhotoLabels
from polarsim.site import polar
from tests.support.label_rows import label_row

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
SEEDS = [PhotoKey.parse(f"{terrain}_A_off_30_L_0256") for terrain in ("03", "11")]

AZIMUTHS = polar().azimuths


def made_up(terrain, seed=1):
    """Return true and propagated labels of some photos of a terrain, with offsets, misses and false positives."""
    rng = np.random.default_rng(seed)
    names = ["A_off_30_L_0256", "A_off_30_L_0064", "A_on_30_L_0256", "A_off_30_R_0256", "A_off_270_L_0256"]
    names += ["A_on_no_L_2048", "C_off_180_R_0512"]
    wanted, found = {}, {}
    for name in names:
        key = PhotoKey.parse(f"{terrain:02d}_{name}")
        low = rng.uniform(0, 1500, (20, 2))
        size = rng.uniform(12, 150, (20, 2))
        boxes, classes = np.hstack([low, low + size]), rng.integers(0, 2, 20)
        classes[:] = 0 if key.azimuth == "no" else classes
        wanted[key] = PhotoLabels(classes[:17], boxes[:17])
        found[key] = PhotoLabels(classes[4:], boxes[4:] + rng.normal(0, 8, (16, 4)))
    return wanted, found


def pairs_of(wanted, found, tasks, against="labels"):
    rows = [
        label_row(key, BOX_CLASSES[number], box=box, source="fused", confidence=0.75)
        for key, labels in found.items()
        for number, box in zip(labels.classes, labels.boxes, strict=True)
    ]
    return pair_labels(wanted, label_table(rows), tasks, against, 256)


@pytest.fixture(scope="module")
def scored():
    """Return the label pairs of two terrains and the metrics of each from `score_tasks`."""
    pairs, metrics = [], {}
    for terrain in (3, 11):
        wanted, found = made_up(terrain, terrain)
        tasks = {key: task_of(key, SEEDS) for key in wanted}
        pairs.append(pairs_of(wanted, found, tasks))
        for metric in score_tasks(wanted, found, tasks, PROPAGATION_TASKS, "labels", 256):
            metrics[f"{terrain:02d}", metric.subject, metric.metric] = metric
    return pairs, metrics


def test_rows_of_terrains_equal_the_metrics_of_scoring(scored):
    pairs, metrics = scored
    rows = label_scores(pd.concat(pairs), AZIMUTHS)
    of_terrains = rows[rows["group"] == "terrain"]
    seen = set()
    for row in of_terrains.to_dict("records"):
        for name, n in (("precision", "label_boxes"), ("recall", "truth_boxes"), ("f1", None), ("miou", "truth_boxes")):
            metric = metrics[row["value"], f"{row['kind']}: {row['task']}", name]
            assert row[name] == pytest.approx(metric.value, nan_ok=True)
            assert n is None or row[n] == metric.n
            seen.add((row["value"], metric.subject, name))
    assert {position for position, metric in metrics.items() if metric.n} <= seen


def test_every_group_is_a_partition_of_the_same_boxes(scored):
    rows = label_scores(pd.concat(scored[0]), AZIMUTHS)
    for _, part in rows.groupby(["kind", "task"]):
        by_group = part.groupby("group")[["truth_boxes", "label_boxes"]].sum()
        assert len(by_group) == 5
        assert (by_group == by_group.loc["all"]).all(axis=None)
        everything = part[part["group"] == "all"].iloc[0]
        for group in ("terrain", "position", "azimuth", "size"):
            values = part[part["group"] == group]
            boxes = values["truth_boxes"] + values["label_boxes"]
            assert np.average(values["f1"], weights=boxes) == pytest.approx(everything["f1"])


def test_by_size_true_boxes_and_labels_are_grouped_by_box_size():
    key = PhotoKey.parse("03_A_off_30_R_0256")
    wanted = {key: PhotoLabels(np.zeros(1, int), np.array([[0, 0, 34, 34.0]]))}
    found = {key: PhotoLabels(np.zeros(1, int), np.array([[0, 0, 36, 36.0]]))}
    rows = label_scores(pairs_of(wanted, found, {key: "light on"}), AZIMUTHS)
    by_size = rows[(rows["group"] == "size") & (rows["task"] == "light on")].set_index("value")
    assert by_size.index.tolist() == ["25-35", "35-50"]
    assert by_size["recall"].tolist() == pytest.approx([1, np.nan], nan_ok=True)
    assert by_size["precision"].tolist() == pytest.approx([np.nan, 1], nan_ok=True)
    assert by_size["f1"].tolist() == [1, 1]
    assert by_size["confidence"].tolist() == pytest.approx([np.nan, 0.75], nan_ok=True)


@given(st.floats(0, 500))
def test_a_size_class_contains_the_size(size):
    name = str(size_class(np.array([size]))[0])
    low, _, high = name.strip("<>").partition("-")
    if name.startswith("<"):
        assert size < float(low)
    elif name.startswith(">"):
        assert size >= float(low)
    else:
        assert float(low) <= size < float(high)


def test_rows_are_sorted_by_task_size_and_azimuth(scored):
    rows = label_scores(pd.concat(scored[0]), AZIMUTHS)
    first = rows[(rows["kind"] == "rock") & (rows["group"] == "all")]["task"].tolist()
    assert first == [task for task in PROPAGATION_TASKS if task in first]
    sizes = rows[(rows["kind"] == "rock") & (rows["task"] == PROPAGATION_TASKS[-1]) & (rows["group"] == "size")][
        "value"
    ].tolist()
    assert sizes == [size for size in SIZES if size in sizes]
    azimuths = rows[(rows["kind"] == "rock") & (rows["task"] == PROPAGATION_TASKS[-1]) & (rows["group"] == "azimuth")]
    assert azimuths["value"].tolist() == ["no", "30", "180", "270"]


def test_the_layout_has_a_block_a_kind_and_a_block_a_group(scored):
    rows = label_scores(pd.concat(scored[0]), AZIMUTHS)
    blocks = format_labels(rows)
    assert len(blocks) == 3 + 3
    rocks = blocks["Labels, rock: F1 (mIoU) by task and terrain."]
    assert rocks.columns.tolist() == ["task", "truth boxes", "precision", "recall", "confidence", "all", "T03", "T11"]
    position = (rows["kind"] == "rock") & (rows["task"] == "no Sun") & (rows["value"] == "11")
    f1, miou = rows.loc[position, ["f1", "miou"]].iloc[0]
    assert rocks.set_index("task").loc["no Sun", "T11"] == f"{f1:.3f} ({miou:.3f})"


def tabulated(folder, tables):
    paths = [folder / f"pairs{number}.parquet" for number in range(len(tables))]
    for path, pairs in zip(paths, tables, strict=True):
        write_parquet(path, pairs)
    tabulate_labels(
        azimuths=AZIMUTHS,
        pairs=paths,
        table=folder / "labels",
        reliability=folder / "reliability",
        seeds="none",
        origin=ORIGIN,
    )


def test_tables_are_written_in_four_forms_with_their_origin(tmp_path, scored):
    tabulated(tmp_path, [*scored[0], scored[0][0].iloc[:0]])  # the last terrain has no box
    for name in ("labels", "reliability"):
        for form in ("csv", "md", "tex", "parquet"):
            assert (tmp_path / f"{name}.{form}").stat().st_size
        assert set(read_csv(tmp_path / f"{name}.csv")["source"]) == {"analog"}
        assert set(read_parquet(tmp_path / f"{name}.parquet")["seeds"]) == {"none"}
        assert "Seeds: none." in (tmp_path / f"{name}.md").read_text()
    pd.testing.assert_frame_equal(
        read_parquet(tmp_path / "labels.parquet").drop(columns=["run", "source", "config", "seeds"]),
        label_scores(pd.concat(scored[0]), AZIMUTHS),
    )
    assert "hand-annotated labels" in (tmp_path / "labels.md").read_text()


def test_terrains_without_boxes_give_empty_tables(tmp_path, scored):
    tabulated(tmp_path, [scored[0][0].iloc[:0]])
    assert len(read_csv(tmp_path / "labels.csv", ["kind", "task", "group", "value"])) == 0
    assert len(read_parquet(tmp_path / "reliability.parquet", ["confidence"])) == 0

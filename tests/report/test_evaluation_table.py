import numpy as np

from polarsim.formats.tables import read_csv, read_parquet
from polarsim.report.evaluation_table import format_evaluation, gather_evaluation, join_metrics, shown_value
from polarsim.scoring.metrics import COLUMNS, Metric, metrics_table, summary_metric, write_metrics
from polarsim.site import polar

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}


def test_metrics_of_all_terrains_and_stages_are_concatenated(tmp_path):
    write_metrics(tmp_path / "labels_03.csv", "labels", 3, [Metric("rock: all", "f1", float("nan"), "1", 0, "truth")])
    for terrain, error in ((3, 1.5), (1, 0.25)):
        metric = Metric("A", "position_error_aligned", error, "mm", 1, "truth")
        write_metrics(tmp_path / f"cameras_0{terrain}.csv", "cameras", terrain, [metric])
    write_metrics(tmp_path / "rocks_06.csv", "rocks", 6, [])  # an empty part does not change the types of columns
    parts = [tmp_path / name for name in ("rocks_06.csv", "labels_03.csv", "cameras_03.csv", "cameras_01.csv")]
    gather_evaluation(parts=parts, stem=tmp_path / "evaluation", site=polar(), origin=ORIGIN)
    table = read_parquet(tmp_path / "evaluation.parquet", ["run", "source", "config", *COLUMNS])
    assert list(table["stage"]) == ["cameras", "cameras", "labels"]
    assert list(table["terrain"]) == [1, 3, 3]
    assert table.dtypes["terrain"] == np.int64
    assert (
        "| cameras | A | position\\_error\\_aligned | mm | truth | 0.25 | 1.50 |"
        in (tmp_path / "evaluation.md").read_text()
    )


def test_terrains_without_metrics_give_an_empty_table(tmp_path):
    write_metrics(tmp_path / "rocks_06.csv", "rocks", 6, [])
    assert list(read_csv(tmp_path / "rocks_06.csv").columns) == list(COLUMNS)
    gather_evaluation(parts=[tmp_path / "rocks_06.csv"], stem=tmp_path / "evaluation", site=polar(), origin=ORIGIN)
    assert len(read_csv(tmp_path / "evaluation.csv", list(COLUMNS))) == 0


def test_rows_of_a_later_terrain_keep_the_order_of_this_terrain():
    first = metrics_table("labels", 1, [Metric("a", "x", 1, "mm", 1, "own"), Metric("c", "x", 1, "mm", 1, "own")])
    second = metrics_table("labels", 4, [Metric(name, "x", 1, "mm", 1, "own") for name in "abc"])
    shown = format_evaluation(join_metrics([first, second]))
    assert list(shown["subject"]) == ["a", "b", "c"]
    assert list(shown["T01"]) == ["1.00", "–", "1.00"]


def test_the_four_metrics_of_a_box_score_share_a_row():
    metrics = [
        Metric("rock", name, share, "1", 9, "truth")
        for name, share in (("precision", 1), ("recall", 0.5), ("f1", 2 / 3), ("miou", 0.4))
    ]
    shown = format_evaluation(metrics_table("labels", 1, metrics))
    assert shown["T01"].tolist() == ["1.000 / 0.500 / 0.667 / 0.400"]
    assert format_evaluation(metrics_table("rocks", 1, metrics[:2]))["metric"].tolist() == ["precision", "recall"]


def test_a_summary_has_median_and_p90_of_the_finite_values():
    metrics = summary_metric("rocks", "distance", np.array([*range(11), np.nan]), "mm", "truth")
    assert [(metric.metric, metric.value, metric.n) for metric in metrics] == [
        ("distance_median", 5, 11),
        ("distance_p90", 9, 11),
    ]
    assert summary_metric("rocks", "distance", np.full(3, np.nan), "mm", "truth") == []


def test_counts_have_no_decimals_and_shares_have():
    shown = [shown_value(value, "1") for value in (1.0, 0.5, 2190130.0, float("nan"))]
    assert shown == ["1.000", "0.500", "2190130", "–"]
    assert (shown_value(2.0, "mm"), shown_value(12.0, "rocks")) == ("2.00", "12")


def test_named_terrains_have_a_column_with_their_name(tmp_path):
    for terrain, error in (("yard-b", 1.5), ("yard-a", 0.25)):
        metric = Metric("1", "position_error_aligned", error, "mm", 1, "truth")
        write_metrics(tmp_path / f"cameras_{terrain}.csv", "cameras", terrain, [metric])
    write_metrics(tmp_path / "rocks_yard-a.csv", "rocks", "yard-a", [])
    gather_evaluation(parts=sorted(tmp_path.glob("*.csv")), stem=tmp_path / "evaluation", site=polar(), origin=ORIGIN)
    assert read_parquet(tmp_path / "evaluation.parquet")["terrain"].tolist() == ["yard-a", "yard-b"]
    shown = format_evaluation(read_csv(tmp_path / "evaluation.csv"))
    assert shown[["subject", "yard-a", "yard-b"]].values.tolist() == [["1", "0.25", "1.50"]]

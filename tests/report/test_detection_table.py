import itertools

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats.tables import read_csv, read_parquet, write_parquet
from polarsim.report import paper
from polarsim.report.detection_table import format_detection, tabulate_detection, tidy_detection
from polarsim.report.ipd_table import format_ipd, tabulate_ipd, tidy_ipd
from polarsim.schemas.report import DETECTION, IPD

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}


def detection(domains=("analog", "hapke", "principled"), kinds=("rock", "shadow")):
    rows = []
    for number, (kind, trained, evaluated) in enumerate(itertools.product(kinds, domains, domains)):
        shares = (0.001 * number, 0.002 * number, 0.003 * number)
        facts = ("photo", 0, True, "yolov5n", "scratch", 12, 320, 96, 0, 500)
        rows.append((trained, evaluated, kind, *facts, *shares, "view", 12, *[np.nan] * 6))
    return pd.DataFrame(rows, columns=list(DETECTION.columns[:-3]))


def ipd(domains=("analog", "hapke", "principled")):
    rows = []
    for trained, (first, second) in itertools.product(domains, itertools.combinations(domains, 2)):
        metrics = (40, 0.1, 0.2, 0.05, 0.15, 0.12, 0.28)
        options = (12, "view", "zero", "left_out", 0.25)
        rows.append(("photo", 0, trained, first, second, "rock", *metrics, *options))
    return pd.DataFrame(rows, columns=list(IPD.columns[:-1]))


@pytest.fixture
def tabulated(tmp_path):
    """Return a function that writes a table (detection or ipd) and returns the Markdown text."""

    def make(write, table, origin=ORIGIN, **further):
        name = write.__name__.removeprefix("tabulate_")
        for key, rows in {name: table, **further}.items():
            write_parquet(tmp_path / f"{key}_in.parquet", rows)
        paths = {key: tmp_path / f"{key}_in.parquet" for key in (name, *further)}
        write(**paths, stem=tmp_path / name, origin=origin)
        return (tmp_path / f"{name}.md").read_text()

    return make


def test_notes_name_the_detector_its_training_split_and_corrupt_images(tmp_path, tabulated):
    left_out = [0, 3, *[0] * (len(detection()) - 2)]
    table = detection().assign(start="random weights", seed=3, left_out=left_out)
    texts = [tabulated(tabulate_detection, table), tabulated(tabulate_ipd, ipd(), detection=table)]
    for text in texts:
        facts = ("Detector yolov5n", "random weights", "12 epochs", "seed 3", "320 px", "split by photo", "96 test")
        assert all(fact in text for fact in (*facts, "3 corrupt"))
    assert all(part in texts[1] for part in ("confidence 0.25;", ": IoU 0;", ": excluded;", "bootstrap over views"))
    assert set(read_parquet(tmp_path / "detection.parquet")["start"]) == {"random weights"}
    assert "corrupt" not in tabulated(tabulate_detection, table.assign(left_out=0))


def test_detectors_of_further_models_have_separate_rows(tmp_path, tabulated):
    """Detectors are not averaged like seeds."""
    ours = detection(kinds=("rock",)).assign(detector="compact (polarsim's own)")
    theirs = detection(kinds=("rock",)).assign(detector="yolov8n", map50=0.75, epochs=1)
    lines = tabulated(tabulate_detection, ours, others=theirs).splitlines()
    assert len(read_csv(tmp_path / "detection.csv")) == 2 * 9
    rows = [line for line in lines if line.startswith("| rock | Analog")]
    assert ["yolov8n, 1 epoch at 320 px" in row for row in rows] == [False, True] * 2  # figures, then intervals
    assert rows[1].count("0.750 /") == 3
    assert "0.750 /" not in rows[0]
    assert sum(line.startswith("Detector yolov8n") or "- Detector yolov8n" in line for line in lines) == 1


def test_every_ipd_of_the_paper_is_the_difference_of_two_published_mean_ious():
    for (trained, (first, second)), value in paper.IPD.items():
        means = [paper.DETECTION[trained, domain][2] for domain in (first, second)]
        assert value == pytest.approx(abs(means[0] - means[1]), abs=1.1e-3)


def test_the_layout_is_that_of_the_paper_with_separate_columns_for_published_values():
    table = tidy_detection(detection(("hapke", "real", "principled")), "release")
    row = table.set_index(["kind", "trained", "evaluated"]).loc[("rock", "principled", "real")]
    assert (row["paper_map50"], row["paper_map50_95"], row["paper_iou_mean"]) == (0.662, 0.318, 0.513)
    assert row["map50"] != row["paper_map50"]
    assert table.loc[table["kind"] != "rock", "paper_map50"].isna().all()
    shown = format_detection(table)
    assert list(shown["T"])[:3] == ["Real", "Principled", "Hapke"]
    assert list(shown.columns[2:5]) == ["E: Real", "E: Principled", "E: Hapke"]
    assert shown.loc[0, "paper, E: Real"] == "0.987 / 0.805 / 0.849"
    assert shown.loc[2, "paper, E: Principled"] == "0.887 / 0.730 / 0.872"


def test_results_on_the_analog_are_never_named_real_and_have_no_published_values(tmp_path, tabulated):
    domains = ("real", "principled", "hapke")
    texts = {
        "detection": tabulated(tabulate_detection, detection(domains, ("rock",))),
        "ipd": tabulated(tabulate_ipd, ipd(domains)),
    }
    for name, text in texts.items():
        table = read_parquet(tmp_path / f"{name}.parquet")
        assert set(table["trained"]) == {"analog", "principled", "hapke"}
        assert "are no photos" in text
        assert "Real" not in next(line for line in text.splitlines() if line.startswith("| labels"))
        assert "aper, " not in text.replace("the paper's table", "")
        published = table.filter(like="paper_")
        assert published.shape[1] > 0
        assert published.isna().all(axis=None)


def test_domains_missing_in_the_paper_have_no_published_value():
    table = tidy_detection(detection(("views", "hapke")), "release")
    published = (table["trained"] == "hapke") & (table["evaluated"] == "hapke") & (table["kind"] == "rock")
    assert table.loc[published, "paper_map50"].tolist() == [0.887]
    assert table.loc[~published, "paper_map50"].isna().all()
    assert "paper, E: Views" not in format_detection(table).columns


def test_a_table_without_rows_is_written_with_all_columns_and_a_missing_column_is_named(tmp_path, tabulated):
    tabulated(tabulate_detection, detection().iloc[:0])
    tabulated(tabulate_ipd, ipd().iloc[:0])
    assert len(read_csv(tmp_path / "detection.csv", ["run", "map50", "paper_map50"])) == 0
    assert len(read_csv(tmp_path / "ipd.csv", ["run", "ipd", "paper_ipd"])) == 0
    with pytest.raises(FormatError, match=r"detection_in\.parquet"):
        tabulated(tabulate_detection, detection().drop(columns="iou_mean"))


def test_ipd_pairs_are_sorted_in_the_order_of_the_paper_for_each_split():
    given = ipd()
    swapped = given.rename(columns={"first": "second", "second": "first"})
    pd.testing.assert_frame_equal(tidy_ipd(given, "analog"), tidy_ipd(swapped[given.columns], "analog"))
    shown = format_ipd(tidy_ipd(ipd(("real", "hapke", "principled")), "files"))
    assert list(shown.columns[2:5]) == ["Principled - Hapke", "Real - Hapke", "Real - Principled"]
    assert shown.loc[0, "Real - Principled"] == "0.1000 [0.050, 0.150] / 0.2000 [0.120, 0.280]"
    assert shown.loc[2, "paper, Real - Hapke"] == "0.4638"
    assert shown.loc[0, "paper, Principled - Hapke"] == "–"
    both = format_ipd(tidy_ipd(pd.concat([given, given.assign(split="terrain")], ignore_index=True), "analog"))
    assert both["split by"].tolist() == ["photo"] * 3 + ["terrain"] * 3


def with_intervals(table):
    bounds = {
        f"{name}_{bound}": table[name] + offset
        for name in ("map50", "map50_95", "iou_mean")
        for bound, offset in (("low", -0.1), ("high", 0.1))
    }
    return table.assign(**bounds, unit="view")


def test_intervals_are_in_a_separate_block(tmp_path, tabulated):
    table = with_intervals(detection(kinds=("rock",)).assign(map50=0.5, map50_95=0.4, iou_mean=0.3))
    text = tabulated(tabulate_detection, table)
    assert "bootstrap over views" in text
    assert text.count("[0.400, 0.600] / [0.300, 0.500] / [0.200, 0.400]") == 9
    assert {"map50_low", "iou_mean_high"} <= set(read_csv(tmp_path / "detection.csv").columns)


def test_several_seeds_are_shown_by_mean_and_deviation_with_the_number_of_seeds(tmp_path, tabulated):
    single = detection(("real", "hapke", "principled"), ("rock",)).assign(map50=0.5, map50_95=0.4, iou_mean=0.3)
    table = pd.concat([single.assign(seed=seed, map50=0.5 + 0.1 * seed) for seed in (0, 1, 2)])
    text = tabulated(tabulate_detection, with_intervals(table), ORIGIN | {"source": "files"})
    assert text.count("0.600 ± 0.100 / 0.400 ± 0.000 / 0.300 ± 0.000") == 9
    assert "n = 3 trainings" in text
    assert "0.987 / 0.805 / 0.849" in text  # the paper has a single training
    assert len(read_csv(tmp_path / "detection.csv", ["seed"])) == 27
    assert r"0.600 $\pm$ 0.100" in (tmp_path / "detection.tex").read_text()
    text = tabulated(tabulate_ipd, pd.concat([ipd().assign(seed=seed, ipd=0.1 + 0.1 * seed) for seed in (0, 1)]))
    assert text.count("0.150 ± 0.071 / 0.200 ± 0.000") == 9
    assert "n = 2 trainings" in text

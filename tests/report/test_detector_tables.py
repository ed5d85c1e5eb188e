import pandas as pd
import pytest

from polarsim.formats.tables import read_csv, read_parquet, write_parquet
from polarsim.report import detectors, ipd_table
from polarsim.schemas.detect import BREAKDOWN, FALSE_POSITIVES, IPD_ROCKS

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}


def breakdown():
    groups = [("all", "all"), ("size", "large"), ("size", "small"), ("exposure", "0256"), ("exposure", "0064")]
    metrics = (0.5, 0.4, 0.6, 0.3, 0.2, 0.4, 0.7, float("nan"), float("nan"))
    rows = [
        ("photo", 0, "hapke", trained, by, group, kind, 10, 4, 50, *metrics)
        for trained in ("real", "hapke")
        for by, group in groups
        for kind in ("shadow", "rock")
    ]
    return pd.DataFrame(rows, columns=list(BREAKDOWN.columns))


def test_a_breakdown_has_a_block_for_each_grouping_with_its_groups_in_order(tmp_path):
    write_parquet(tmp_path / "b.parquet", breakdown())
    detectors.tabulate_breakdown(breakdown=tmp_path / "b.parquet", stem=tmp_path / "t", origin=ORIGIN)
    text = (tmp_path / "t.md").read_text()
    headers = [line for line in text.splitlines() if line.startswith("| labels")]
    assert headers == [
        "| labels | T | E | all |", "| labels | T | E | small | large |", "| labels | T | E | 0064 | 0256 |",
    ]  # fmt: skip
    assert "| rock | Hapke | Analog | 0.500 [0.400, 0.600] |" in text
    assert "Real |" not in text
    assert "32 x 32 px" in text
    assert len(read_csv(tmp_path / "t.csv", ["run", "by", "group", "iou_mean_low"])) == 20


def test_a_breakdown_of_several_seeds_shows_the_standard_deviation(tmp_path):
    write_parquet(tmp_path / "b.parquet", pd.concat([breakdown().assign(seed=n, map50=0.2 * n) for n in (1, 2)]))
    detectors.tabulate_breakdown(breakdown=tmp_path / "b.parquet", stem=tmp_path / "t", origin=ORIGIN)
    assert "| 0.300 ± 0.141 |" in (tmp_path / "t.md").read_text()


def test_false_positives_are_shown_per_photo_and_in_percent_of_the_area(tmp_path):
    row = ("photo", 0, "hapke", "real", "rock-free terrain", "06", 45, 4, 45.0, 24, 0.5, 0.25, 0.75, 0.01, 0.005, 0.02)
    write_parquet(tmp_path / "f.parquet", pd.DataFrame([row], columns=list(FALSE_POSITIVES.columns)))
    detectors.tabulate_false_positives(false_positives=tmp_path / "f.parquet", stem=tmp_path / "t", origin=ORIGIN)
    text = (tmp_path / "t.md").read_text()
    shown = "| rock-free terrain | Hapke | Analog | 06 | 45 | 0.500 [0.250, 0.750] | 1.000 [0.500, 2.000] |"
    assert shown in text
    assert read_parquet(tmp_path / "t.parquet")["area_share"].tolist() == [0.01]


def test_the_rocks_with_the_largest_difference_are_shown_and_pairs_are_in_the_order_of_the_paper(tmp_path):
    rows = [
        ("photo", 0, "hapke", "hapke", "principled", 1, rock, "rock", 4, 0.5, 0.5 + 0.01 * rock, -0.01 * rock)
        for rock in range(1, 9)
    ]
    table = pd.DataFrame(rows, columns=list(IPD_ROCKS.columns))
    write_parquet(tmp_path / "r.parquet", table)
    ipd_table.tabulate_ipd_rocks(rocks=tmp_path / "r.parquet", stem=tmp_path / "t", origin=ORIGIN)
    lines = [line for line in (tmp_path / "t.md").read_text().splitlines() if line.startswith("| Hapke")]
    assert len(lines) == ipd_table.SHOWN
    assert lines[0] == "| Hapke | Principled - Hapke | 1 | 8 | 4 | 0.580 | 0.500 | 0.080 |"
    assert len(read_csv(tmp_path / "t.csv")) == 8


VALUES = {
    "value": 0.6, "other_value": 0.3, "difference": 0.3, "difference_low": 0.1, "difference_high": 0.5, "pairs": 90,
    "images": 144, "units": 16, "unit": "view",
}  # fmt: skip


def difference(metric, kind, against, sides, seed=0, **values):
    names = ("trained", "evaluated", "other_trained", "other_evaluated")
    keys = {"split": "photo", "seed": seed, "metric": metric, "kind": kind, "against": against}
    return keys | dict(zip(names, sides, strict=True)) | VALUES | values


@pytest.fixture
def differences(tmp_path):
    def tabulate(rows):
        write_parquet(tmp_path / "differences.parquet", pd.DataFrame(rows))
        detectors.tabulate_differences(
            differences=tmp_path / "differences.parquet", detection=None, stem=tmp_path / "t", origin=ORIGIN
        )
        text = (tmp_path / "t.md").read_text()
        shown = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
        return read_parquet(tmp_path / "t.parquet"), shown, text

    return tabulate


def test_differences_of_rocks_are_first_and_each_row_names_both_sides(differences):
    rows = [
        difference("map50", "shadow", "", ("real", "real", "real", "hapke")),
        difference("ipd", "rock", "real", ("hapke", "principled", "hapke", "hapke")),
        difference("map50", "rock", "", ("real", "real", "real", "hapke")),
    ]
    table, shown, _ = differences(rows)
    order = [("rock", "map50"), ("rock", "ipd"), ("shadow", "map50")]
    assert list(zip(table["kind"], table["metric"], strict=True)) == order
    sides = ["rock", "mAP@0.5", "Analog on Analog", "Analog on Hapke"]
    assert shown[2] == [*sides, "0.600", "0.300", "0.300 [0.100, 0.500]"]
    assert shown[3][2:4] == ["Hapke on Analog and Principled", "Hapke on Analog and Hapke"]
    assert "real" not in set(table["trained"])  # images of the analog are never named real


def test_differences_of_several_trainings_are_shown_with_standard_deviation(differences):
    sides = ("real", "real", "real", "hapke")
    rows = [
        difference("map50", "rock", "", sides, seed, difference=d, value=v)
        for seed, d, v in ((0, 0.3, 0.6), (1, 0.5, 0.8))
    ]
    _, shown, text = differences(rows)
    assert shown[2][4:] == ["0.700 ± 0.141", "0.300 ± 0.000", "0.400 ± 0.141"]
    assert "n = 2 trainings" in text


def test_tables_without_rows_are_written_with_all_columns(tmp_path):
    for columns, name, write in (
        (BREAKDOWN.columns, "breakdown", detectors.tabulate_breakdown),
        (FALSE_POSITIVES.columns, "false_positives", detectors.tabulate_false_positives),
        (IPD_ROCKS.columns, "rocks", ipd_table.tabulate_ipd_rocks),
    ):
        write_parquet(tmp_path / "e.parquet", pd.DataFrame(columns=list(columns)))
        write(**{name: tmp_path / "e.parquet"}, stem=tmp_path / name, origin=ORIGIN)
        assert len(read_csv(tmp_path / f"{name}.csv", columns)) == 0

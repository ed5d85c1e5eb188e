import numpy as np
import pytest
from typer.testing import CliRunner

from polarsim.cli import app
from polarsim.errors import PolarsimError
from polarsim.formats.tables import key_columns, read_csv, typed, write_csv, write_parquet
from polarsim.photo import PhotoKey
from polarsim.report.evaluation_table import compare_runs
from polarsim.report.label_comparison import compare_labels
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.mesh_scores import mesh_table
from polarsim.scoring.metrics import Metric, write_metrics


def measured(folder, run, terrain, value):
    metric = Metric("A", "position_error_aligned", value, "mm", 1, "truth")
    write_metrics(folder / run / f"evaluation/cameras_Terrain{terrain:02d}.csv", "cameras", terrain, [metric])


def test_the_cells_of_a_terrain_list_all_runs(tmp_path):
    measured(tmp_path, "seed1", 3, 1.0)
    measured(tmp_path, "seed1", 1, 2.0)
    measured(tmp_path, "seed2", 1, 4.0)
    write_csv(tmp_path / "seed1/evaluation/meshes_Terrain01.csv", mesh_table([]))  # not a table of metrics
    compare_runs(runs=[tmp_path / "seed1", tmp_path / "seed2"], stem=tmp_path / "both")
    text = (tmp_path / "both.md").read_text()
    assert (
        "| mm | truth | 2.00 / 4.00 | 1.00 / – | 2.00 / 4.00 |" in text
    )  # the medians are of terrain 1, which both runs have
    assert "seed1 / seed2" in text.splitlines()[0]
    table = read_csv(tmp_path / "both.csv")
    assert table[["run", "terrain", "value"]].values.tolist() == [["seed1", 1, 2], ["seed2", 1, 4], ["seed1", 3, 1]]


def test_medians_are_over_terrains_shared_by_the_runs_that_have_the_metric(tmp_path):
    for run, terrain, value in (("one", 1, 2.0), ("one", 3, 4.0), ("other", 6, 9.0)):
        measured(tmp_path, run, terrain, value)
    compare_runs(runs=[tmp_path / "one", tmp_path / "other"], stem=tmp_path / "both")
    assert (tmp_path / "both.md").read_text().splitlines()[4].endswith("| – / – |")
    rocks = [Metric("A", "found", 0.5, "1", 1, "truth")]
    write_metrics(tmp_path / "third/evaluation/rocks_Terrain03.csv", "rocks", 3, rocks)
    compare_runs(runs=[tmp_path / "one", tmp_path / "third"], stem=tmp_path / "both")
    assert "| 3.00 / – |" in (tmp_path / "both.md").read_text()


@pytest.mark.parametrize("terrain", [None, 3])
def test_a_run_without_metrics_or_without_common_metrics_is_an_error(tmp_path, terrain):
    measured(tmp_path, "one", 1, 1.0)
    if terrain:
        measured(tmp_path, "other", terrain, 1.0)
    with pytest.raises(PolarsimError):
        compare_runs(runs=[tmp_path / "one", tmp_path / "other"], stem=tmp_path / "both", common=True)
    assert not list(tmp_path.glob("both.*"))


def test_the_command_prints_the_path_of_the_table(tmp_path):
    measured(tmp_path, "seed1", 1, 1.0)
    done = CliRunner().invoke(app, ["compare", "seed1", "--results", str(tmp_path), "--out", str(tmp_path / "one")])
    assert done.exit_code == 0
    assert done.stdout.strip() == str(tmp_path / "one.md")


def test_the_command_compares_common_metrics_and_prints_differences(tmp_path):
    for run, values in {"one": {1: 0.5, 3: 0.9}, "other": {1: 0.75, 6: 0.1}}.items():
        for terrain, value in values.items():
            metrics = [Metric("rock: all", "f1", value, "1", 40 + terrain, "truth")]
            write_metrics(tmp_path / run / f"evaluation/labels_Terrain{terrain:02d}.csv", "labels", terrain, metrics)
    measured(tmp_path, "one", 1, 2.0)  # a metric of a single run
    call = ["compare", "one", "other", "--results", str(tmp_path), "--out", str(tmp_path / "both")]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0
    table = read_csv(tmp_path / "both.csv")
    assert table[["run", "terrain", "metric", "value"]].values.tolist() == [
        ["one", 1, "f1", 0.5],
        ["other", 1, "f1", 0.75],
    ]
    assert table["difference"].isna().tolist() == [True, False]
    assert table["difference"][1] == 0.25
    assert "+0.250" in (tmp_path / "both.md").read_text()
    (line,) = [line for line in done.stdout.splitlines() if "rock: all" in line]
    assert all(part in line for part in ("f1", "0.500 / 0.750", "+0.250", "41 / 41"))

    assert CliRunner().invoke(app, [*call, "--all"]).exit_code == 0
    everything = read_csv(tmp_path / "both.csv")
    assert len(everything) == 5
    rows = everything.set_index(["run", "terrain", "metric"])["difference"]
    assert rows.notna().sum() == 1
    assert rows["other", 1, "f1"] == 0.25


def pairs(folder, run, hits, task="light on", skipped=()):
    """Write the matches of a run: a true box per photo and azimuth, found if the azimuth is in `hits`."""
    rows = []
    for position in "AC":
        for azimuth in ("30", "180", "270", "350"):
            key = PhotoKey(3, position, "on", azimuth, "L", 256)
            if str(key) in skipped:
                continue
            found = {"hit": azimuth in hits, "label_px": 20.0 if azimuth in hits else np.nan}
            row = {**key_columns(key), "task": task, "kind": "rock", "annotated": False, "truth_px": 20.0, **found}
            rows.append(row | {"rock": 1, "source": "fused", "against": "truth"})
    table = typed(rows, LABEL_PAIRS)
    write_parquet(folder / run / "evaluation/label_pairs_Terrain03.parquet", table)
    measured(folder, run, 3, 1.0)


def test_labels_are_compared_on_the_photos_that_both_runs_score(tmp_path):
    seed = "03_A_on_30_L_0256"
    pairs(tmp_path, "all", ("30", "180", "270", "350"), skipped=(seed,))
    pairs(tmp_path, "half", ("30", "180"), task="another azimuth")
    call = ["compare", "all", "half", "--results", str(tmp_path), "--out", str(tmp_path / "both")]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.stderr
    table = read_csv(tmp_path / "both-labels.csv").set_index(["kind", "task"])
    assert table.index.tolist() == [("rock", "all but seeds"), ("rock", "another azimuth")]
    row = table.loc["rock", "all but seeds"]
    assert (row["photos"], row["truth_boxes"], row["f1_first"]) == (7, 7, 1)
    assert row["f1"] == pytest.approx(2 * 3 / (7 + 3), abs=1e-6)  # 3 of 7 true boxes have a label
    assert row["difference"] == pytest.approx(-0.4, abs=1e-6)
    assert row["difference_low"] == pytest.approx(row["f1_low"] - 1, abs=1e-6)  # paired: the first run is always 1
    assert -1 <= row["difference_low"] < row["difference"] < row["difference_high"] <= 0
    assert "-0.400 [" in (tmp_path / "both-labels.md").read_text()
    assert "0.600" in done.stdout
    assert max(map(len, done.stdout.replace(str(tmp_path), "").splitlines())) <= 80


def test_equal_labels_have_no_difference(tmp_path):
    for run in ("one", "other"):
        pairs(tmp_path, run, ("30", "270"))
    table = compare_labels([tmp_path / "one", tmp_path / "other"], tmp_path / "both-labels")
    assert table["difference"].tolist() == table["difference_low"].tolist() == table["difference_high"].tolist() == [0]
    pairs(tmp_path, "third", (), skipped=[f"03_{p}_on_{a}_L_0256" for p in "AC" for a in ("30", "180", "270", "350")])
    assert compare_labels([tmp_path / "one", tmp_path / "third"], tmp_path / "none").empty
    assert not list(tmp_path.glob("none*"))

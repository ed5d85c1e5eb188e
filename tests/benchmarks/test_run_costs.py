"""Costs of a run, from the benchmark files that Snakemake wrote."""

import pandas as pd
import pytest

from benchmarks import run_costs

HEAD = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"


def test_jobs_count_for_their_rule_even_where_one_rules_name_begins_anothers(tmp_path):
    folder = tmp_path / "benchmarks/render"
    folder.mkdir(parents=True)
    for name, seconds in (("render_twins_01", 4), ("render_twins_11", 6), ("merge_labels", 1), ("predict_a_on_b", 2)):
        (folder / f"{name}.tsv").write_text(
            f"{HEAD}{seconds}\t0:00:04\t{100 * seconds}\t1\t1\t1\t0\t7\t50\t{seconds / 2}\n"
        )
    (folder / "predict_component_01.tsv").write_text(f"{HEAD}3\t0:00:03\t-\t-\t-\t-\t-\t-\t-\t-\n")
    table = run_costs.rule_costs(run_costs.job_costs(tmp_path))
    assert table.loc["render_twins"].to_dict() == {"jobs": 2, "cpu_s": 5, "wall_s": 10, "peak_mb": 600, "written_mb": 7}
    assert set(table.index) == {"render_twins", "merge_labels", "predict", "predict_component"}
    assert pd.isna(table.loc["predict_component", "peak_mb"])


def test_a_run_without_benchmark_files_ends_in_one_line(tmp_path):
    with pytest.raises(SystemExit, match="no benchmark files"):
        run_costs.job_costs(tmp_path)


def test_disk_counts_each_file_in_every_folder_above_it_and_no_links(tmp_path):
    (tmp_path / "renders/hapke").mkdir(parents=True)
    (tmp_path / "renders/hapke/a.png").write_bytes(bytes(3_000_000))
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels/b.txt").write_bytes(bytes(10))
    (tmp_path / "labels/link.png").symlink_to(tmp_path / "renders/hapke/a.png")
    (tmp_path / "renders/hapke/again.png").hardlink_to(tmp_path / "renders/hapke/a.png")
    assert run_costs.disk(tmp_path) == {".": 3.0, "renders": 3.0, "renders/hapke": 3.0}

"""The workflow as a module of another workflow in another folder: rules, places of results, configuration."""

import re
import shutil
from pathlib import Path

import pytest
import yaml

from tests.workflow.conftest import CHECKOUT, SMALL, jobs_with, planned

CALLER = """
configfile: "config/config.yaml"

rule count:
    input: "{results}/small/renders/reflectance.csv"
    output: "count.txt"
    shell: "wc -l < {{input}} > {{output}}"

module polarsim:
    snakefile: "{checkout}/workflow/Snakefile"
    config: config["lunar"]
    {prefix}

use rule * from polarsim as polarsim_*

onstart:
    polarsim.onstart()
"""
BELOW_LUNAR = {"prefix": 'prefix: "lunar"', "results": "lunar/results"}


@pytest.fixture
def caller(tmp_path: Path):
    """Return a function that writes another workflow with the small configuration, and an unrelated `config.yaml`."""

    def write(prefix: str = "", results: str = "results", **lunar: object) -> Path:
        (tmp_path / "config").mkdir()
        content = {"lunar": SMALL | lunar, "unrelated": 1}
        (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(content))
        (tmp_path / "Snakefile").write_text(CALLER.format(checkout=CHECKOUT, prefix=prefix, results=results))
        return tmp_path

    return write


def test_another_workflow_plans_all_stages_below_its_prefix(caller, snakemake):
    rover = {"run": True, "seeds": [1], "detector": "mixed", "bags": False}
    folder = caller(**BELOW_LUNAR, rover=rover | {"world": {"terrains": [1]}})
    done = snakemake(folder, "polarsim_all", "polarsim_publish", "count", "--dry-run", "--printshellcmds")
    jobs, text = planned(done), done.stdout + done.stderr
    assert {name for name in jobs if not name.startswith("polarsim_")} == {"count", "total"}
    own = {"generate_analog", "train_detector", "run_ablation", "publish_run", "detect_drive", "write_results_page"}
    assert {f"polarsim_{name}" for name in own} <= set(jobs)
    places = set(re.findall(r"[ ,](\S*)results/small/", text))
    assert places == {"lunar/"}
    assert f"output: {folder}/data/analog/receipts/Terrain01.json" in text  # named by the configuration
    (job,) = jobs_with(text, "write_reflectance.log")
    assert "log: lunar/results/small/logs/render/write_reflectance.log" in job
    assert f"{CHECKOUT}/config/viper.yaml" in text.replace("polarsim/configs", "config")


def test_another_workflow_runs_jobs_with_the_scripts_of_the_module_and_shares_outputs(caller, snakemake):
    folder = caller(**BELOW_LUNAR)
    (folder / "cache").mkdir()
    outputs = []
    for _ in range(2):
        shutil.rmtree(folder / "lunar", ignore_errors=True)
        done = snakemake(
            folder, "count", "--force", "--cache", "polarsim_write_reflectance",
            SNAKEMAKE_OUTPUT_CACHE=str(folder / "cache"),
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-3000:]
        outputs.append(done.stdout + done.stderr)
        curves = folder / "lunar/results/small/renders/reflectance.csv"
        assert int((folder / "count.txt").read_text()) == len(curves.read_text().splitlines()) > 10
        stored = yaml.safe_load((folder / "lunar/results/small/config.yaml").read_text())
        assert stored["render"]["models"] == ["hapke"]
    assert ["Moving output file" in text for text in outputs] == [True, False]  # written once
    assert all("Symlinking output file" in text for text in outputs)


def test_a_module_without_source_is_an_overlay_of_the_demo(caller, snakemake):
    folder = caller('replace_prefix: {"results/": "lunar/results/"}')
    (folder / "config/config.yaml").write_text(yaml.safe_dump({"lunar": {"run": "small", "terrains": [3]}}))
    done = snakemake(folder, "polarsim_acquire", "--dry-run")
    assert planned(done)["polarsim_index_terrain"] == 1
    assert "output: data/analog/receipts/Terrain03.json" in done.stdout + done.stderr  # other rules can share it
    assert "output: lunar/results/small/acquire/photos.parquet" in done.stdout + done.stderr


def test_an_invalid_configuration_of_a_module_is_one_line(caller, snakemake):
    done = snakemake(caller(terains=[1]), "--dry-run")
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    assert done.returncode == 1
    assert line.startswith("error: module polarsim, config: ")
    assert "terains" in line
    assert "Traceback" not in done.stderr

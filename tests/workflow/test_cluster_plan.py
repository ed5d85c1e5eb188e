"""Cluster profiles: submissions per terrain, memory and time of every rule, GPUs of configured devices."""

import re
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PROFILES = {name: ROOT / f"config/profiles/{name}" for name in ("slurm", "cluster-generic")}


@pytest.fixture(scope="module")
def plan(dry_run) -> subprocess.CompletedProcess:
    """Plan of the demo with the SLURM profile."""
    return dry_run("--profile", "config/profiles/slurm", "--configfile", "config/config.yaml")


def submissions(done: subprocess.CompletedProcess) -> list[list[str]]:
    """Return rules and wildcards of the jobs of every planned submission."""
    assert done.returncode == 0, done.stdout + done.stderr
    text = (done.stdout + done.stderr).replace("localrule", "local")
    parts = re.split(r"^(?:\[.*\] Group job \w+|rule \w+:)", text, flags=re.MULTILINE)
    heads = re.findall(r"^(?:\[.*\] Group job \w+|rule \w+:)", text, flags=re.MULTILINE)
    return [re.findall(r"rule \w+:|terrain=\d\d", head + part) for head, part in zip(heads, parts[1:], strict=True)]


def terrains_of(jobs: list[str]) -> set[str]:
    return {word for word in jobs if word.startswith("terrain=")}


def test_a_terrain_has_four_submissions_and_no_submission_has_two_terrains(plan):
    made = submissions(plan)
    own = [jobs for jobs in made if terrains_of(jobs) and "rule write_results_page:" not in jobs]
    assert sum(len([word for word in jobs if word.startswith("rule")]) for jobs in own) > 40
    assert all(len(terrains_of(jobs)) == 1 for jobs in own)  # a failed terrain does not stop others
    counts = [sum(terrain in jobs for jobs in own) for terrain in set().union(*map(terrains_of, own))]
    assert counts == [4] * 3  # generation, survey, views, figures of meshes
    assert len(made) - len(own) < 30  # detectors, and one for all tables


def test_both_profiles_make_the_same_groups_of_rules_that_are_there():
    first, second = (yaml.safe_load((folder / "config.yaml").read_text()) for folder in PROFILES.values())
    text = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    assert first["groups"] == second["groups"]
    assert set(first["groups"]) <= set(re.findall(r"rule (?:\w+ as )?(\w+)(?: with)?:", text))
    same = {"cores", "resources", "retries", "keep-going", "rerun-incomplete", "latency-wait"}
    assert {key: first[key] for key in same} == {key: second[key] for key in same}


def rules() -> dict[str, str]:
    """Return the text of every rule with script and resources."""
    parts = re.split(r"^ *rule ", "".join(p.read_text() for p in (ROOT / "workflow/rules").glob("*.smk")), flags=re.M)
    texts = [re.split(r"^ *use rule ", part, flags=re.MULTILINE)[0] for part in parts]
    return {text.partition(":")[0]: text for text in texts if "    script:" in text}


def test_every_rule_defines_memory_and_time():
    known = rules()
    assert len(known) > 60
    for name, text in known.items():
        assert re.search(r"mem_mb=memory_per_attempt\(\d+\)", text), name
        assert re.search(r"runtime=\d+", text), name


def test_no_rule_exceeds_the_memory_of_a_submission():
    first = yaml.safe_load((PROFILES["slurm"] / "config.yaml").read_text())
    most = max(int(found) for text in rules().values() for found in re.findall(r"memory_per_attempt\((\d+)\)", text))
    assert 2 ** first["retries"] * most <= first["resources"]["mem_mb"]


PROBE = """
rule probe:
    output: "made"
    resources: mem_mb=memory_per_attempt(100), runtime=1
    shell: "echo {resources.mem_mb} >> tried; test {resources.mem_mb} -gt 300 && touch made"
"""


def test_a_second_try_has_twice_the_memory(checkout, snakemake):
    with (checkout / "Snakefile").open("a") as file:
        file.write(PROBE)
    done = snakemake(checkout, "made", "--retries", "3", "--configfile", "config/config.yaml")
    assert done.returncode == 0, done.stderr
    assert (checkout / "tried").read_text().split() == ["100", "200", "400"]


def test_only_jobs_on_a_device_request_a_gpu(dry_run, plan):
    device = "detect={prediction: {device: cuda}, training: {model: compact}}"
    done = dry_run("--config", device, "render={engine: taichi, device: cuda}")
    assert done.returncode == 0, done.stdout + done.stderr
    jobs = re.split(r"\n(?=rule |localrule )", done.stdout + done.stderr)
    asked = {job.split(":")[0].removeprefix("rule ") for job in jobs if re.search(r"\bgpu=1\b", job)}
    others = {"train_other_detector", "predict_by_other"}
    assert asked == {"train_detector", "predict", "render_twins"} | others
    assert "gpu=0" in plan.stdout + plan.stderr
    assert "gpu=1" not in plan.stdout + plan.stderr


@pytest.mark.parametrize("state", ["COMPLETED", "PENDING", "RUNNING", "REQUEUED", "FAILED", "CANCELLED", "TIMEOUT"])
def test_the_status_script_distinguishes_states(tmp_path, state):
    substitute = tmp_path / "scontrol"
    substitute.write_text(f"#!/bin/sh\necho JobId=7 JobName=x JobState={state} Reason=None\n")
    substitute.chmod(0o755)
    script = PROFILES["cluster-generic"] / "status.sh"
    done = subprocess.run([script, "7"], env={"PATH": f"{tmp_path}:/usr/bin:/bin"}, capture_output=True, text=True)
    expected = {"COMPLETED": "success", "PENDING": "running", "RUNNING": "running", "REQUEUED": "running"}
    assert done.stdout.strip() == expected.get(state, "failed")


def test_the_submit_script_passes_the_resources(tmp_path):
    substitute = tmp_path / "sbatch"
    substitute.write_text('#!/bin/sh\necho "$@"\n')
    substitute.chmod(0o755)
    call = [PROFILES["cluster-generic"] / "submit.sh", "2", "4000", "30"]
    path = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
    plain, gpu = (
        subprocess.run([*call, gpus, "job.sh"], env=path, cwd=tmp_path, capture_output=True, text=True).stdout.split()
        for gpus in ("0", "1")
    )
    assert {"--cpus-per-task=2", "--mem=4000", "--time=30", "job.sh"} <= set(plain)
    assert set(gpu) - set(plain) == {"--gpus=1"}


@pytest.mark.parametrize(("reason", "stuck"), [("Resources", False), ("Priority", False), ("PartitionConfig", True)])
def test_the_watchdog_names_jobs_that_would_wait_for_ever(tmp_path, reason, stuck):
    substitute = tmp_path / "squeue"
    substitute.write_text(f'#!/bin/sh\necho "12 run 5 cores 4000M: {reason}"\n')
    substitute.chmod(0o755)
    script = PROFILES["slurm"] / "waiting.sh"
    done = subprocess.run([script], env={"PATH": f"{tmp_path}:/usr/bin:/bin"}, capture_output=True, text=True)
    assert done.returncode == int(stuck)
    assert (reason in done.stdout) == stuck

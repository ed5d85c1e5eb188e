"""Targets that `polarsim run` rejects before Snakemake starts the run."""

import subprocess
from pathlib import Path

import pytest

from polarsim.errors import ConfigError
from polarsim.running.targets import CallError, refuse_unknown, stages_of_rules, targets_of

CHECKOUT = Path(__file__).parents[2]


def refuse(monkeypatch, returncode: int, stderr: str, target: str = "results/mine/tables/labels.csv") -> None:
    """Check a target for which Snakemake's summary has this exit code and this text."""
    done = subprocess.CompletedProcess([], returncode, "", stderr)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)
    refuse_unknown(Path(), "mine", [target], [])


def test_an_error_of_the_workflow_is_raised_in_one_line(monkeypatch):
    with pytest.raises(ConfigError, match=r"scoring\.annotated_root") as error:
        refuse(monkeypatch, 1, "Building DAG of jobs...\nerror: no labels; set scoring.annotated_root\n")
    assert "\n" not in str(error.value)
    assert "error: " not in str(error.value)


@pytest.mark.parametrize("name", ["report_label_scores", "tabulate_evaluation", "generate_analog", "mesh_rocks"])
def test_a_rule_with_wildcards_is_a_usage_error_with_a_remedy(name):
    with pytest.raises(CallError, match=rf"rule {name} .* labels") as error:
        refuse_unknown(CHECKOUT, "mine", [name], [])
    assert "\n" not in str(error.value)


def test_all_rules_with_outputs_are_refused_before_the_run():
    for name in stages_of_rules(CHECKOUT):
        with pytest.raises(CallError, match=name):
            refuse_unknown(CHECKOUT, "mine", [name], [])


def test_stages_and_all_are_targets():
    refuse_unknown(CHECKOUT, "mine", ["all", "labels", "geometry", "rover"], [])


def test_help_names_every_stage(polarsim, monkeypatch):
    monkeypatch.setenv("COLUMNS", "500")  # no line breaks inside names
    text = polarsim("run", "--help").stdout
    with pytest.raises(CallError) as error:
        refuse_unknown(CHECKOUT, "mine", ["no_stage"], [])
    stages = str(error.value).partition("Stages: ")[2].split(", ")
    assert [stage for stage in stages if stage not in text] == []
    assert "before_after" in stages


def test_a_file_without_a_rule_is_a_usage_error(monkeypatch):
    with pytest.raises(CallError, match=r"labels\.csv") as error:
        refuse(monkeypatch, 1, "MissingRuleException:\nNo rule to produce results/mine/tables/labels.csv\n")
    assert "begin with" not in str(error.value)
    with pytest.raises(CallError, match=r"tables/labels\.csv: .*begin with results/mine/$"):
        refuse(monkeypatch, 1, "MissingRuleException:\nNo rule to produce tables/labels.csv\n", "tables/labels.csv")


def test_many_files_are_checked_in_a_single_plan(monkeypatch):
    files = [f"results/mine/tables/{name}.csv" for name in ("labels", "cameras", "nosuch", "meshes")]
    plans = []

    def plan(words, **_):
        plans.append(words)
        error = f"MissingRuleException:\nNo rule to produce {files[2]} (if you use input functions ...)\n"
        return subprocess.CompletedProcess(words, 1, "", error)

    monkeypatch.setattr(subprocess, "run", plan)
    with pytest.raises(CallError, match="nosuch"):
        refuse_unknown(Path(), "mine", files, [])
    (words,) = plans
    assert set(files) <= set(words)


@pytest.mark.parametrize(("returncode", "stderr"), [(0, "error: printed by a plan that succeeds\n"), (1, "locked\n")])
def test_other_errors_of_snakemake_are_reported_by_the_run(monkeypatch, returncode, stderr):
    refuse(monkeypatch, returncode, stderr)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("-n", "--nosuchoption"), "--nosuchoption"),
        (("--nosuchoption=3", "-n"), "--nosuchoption"),
        (("--nosuchoption", "value"), "--nosuchoption"),
        (("-n", "--min-fre=3"), "--min-free"),
        (("-n", "--keep-goin=1"), "--keep-goin"),
        (("--retries", "many"), "--retries"),
    ],
)
def test_an_unknown_option_is_a_usage_error_that_names_the_option(words, named):
    with pytest.raises(CallError) as error:
        targets_of(["labels"], words)
    assert named in str(error.value)
    assert "\n" not in str(error.value)


def test_options_of_snakemake_and_its_plugins_are_accepted():
    rest = ("-n", "--keep-going", "--executor", "slurm", "--slurm-keep-successful-logs", "--set-threads", "a=2")
    assert targets_of(["labels"], rest) == ["labels"]


@pytest.mark.parametrize("value", ["run", "=x", "", "run=["])
@pytest.mark.parametrize("command", [("run", "-n", "--config"), ("render", "a.obj", "a.png", "--option")])
def test_a_setting_without_key_and_value_is_a_usage_error(polarsim, command, value):
    done = polarsim(*command, value)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert command[-1] in line
    assert "KEY=VALUE" in line or "YAML" in line


def test_an_unknown_option_of_the_command_is_a_usage_error(polarsim):
    done = polarsim("run", "-n", "--nosuchoption")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "--nosuchoption" in line

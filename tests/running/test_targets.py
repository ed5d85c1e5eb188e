"""Targets that `polarsim run` rejects before Snakemake starts the run."""

import subprocess
from pathlib import Path

import pytest

from polarsim.errors import ConfigError
from polarsim.running.targets import CallError, refuse_unknown


def refuse(monkeypatch, returncode: int, stderr: str) -> None:
    """Check a target for which Snakemake's summary has this exit code and this text."""
    done = subprocess.CompletedProcess([], returncode, "", stderr)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)
    refuse_unknown(Path(), "mine", ["results/mine/tables/labels.csv"], [])


def test_an_error_of_the_workflow_is_raised_in_one_line(monkeypatch):
    with pytest.raises(ConfigError, match=r"scoring\.annotated_root") as error:
        refuse(monkeypatch, 1, "Building DAG of jobs...\nerror: no labels; set scoring.annotated_root\n")
    assert "\n" not in str(error.value)
    assert "error: " not in str(error.value)


def test_a_file_without_a_rule_is_a_usage_error(monkeypatch):
    with pytest.raises(CallError, match=r"labels\.csv"):
        refuse(monkeypatch, 1, "MissingRuleException:\nNo rule to produce results/mine/tables/labels.csv\n")


@pytest.mark.parametrize(("returncode", "stderr"), [(0, "error: printed by a plan that succeeds\n"), (1, "locked\n")])
def test_other_errors_of_snakemake_are_reported_by_the_run(monkeypatch, returncode, stderr):
    refuse(monkeypatch, returncode, stderr)

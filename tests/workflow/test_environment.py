"""Environments of the workflow: `.venv`, Conda, and the lock file of both."""

import os
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.version import Version

CHECKOUT = Path(__file__).parents[2]
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
LOCKED_EXTRAS = ("cluster", "detect", "dev", "publish", "rover")  # as in `make lock`
ENVIRONMENT = CHECKOUT / "workflow/envs/polarsim.yaml"
# Substitute of conda with the answers that Snakemake needs for planning.
CONDA = """#!/bin/sh
case "$1" in
info) echo '{"conda_version": "25.1.0", "conda_prefix": "/opt/conda", "platform": "linux-64"}' ;;
config) echo '{"get": {"channel_priority": "strict"}}' ;;
--version) echo 'conda 25.1.0' ;;
*) exit 1 ;;
esac
"""


def locked() -> dict[str, Version]:
    pins = [Requirement(line) for line in (CHECKOUT / "requirements.lock").read_text().splitlines()]
    return {pin.name.lower(): Version(str(pin.specifier).removeprefix("==")) for pin in pins}


@pytest.mark.parametrize("extra", ["", *LOCKED_EXTRAS])
def test_the_lock_satisfies_the_requirements_of_the_project(extra):
    asked = PROJECT["optional-dependencies"][extra] if extra else PROJECT["dependencies"]
    pins = locked()
    for requirement in map(Requirement, asked):
        assert requirement.name.lower() in pins, requirement
        assert requirement.specifier.contains(pins[requirement.name.lower()]), requirement


def test_make_lock_locks_these_extras():
    (command,) = [line for line in (CHECKOUT / "Makefile").read_text().splitlines() if "uv pip compile" in line]
    words = command.split()
    assert {words[place + 1] for place, word in enumerate(words) if word == "--extra"} == set(LOCKED_EXTRAS)


def test_condas_python_is_one_that_polarsim_runs_on():
    (python,) = [one for one in yaml.safe_load(ENVIRONMENT.read_text())["dependencies"] if one.startswith("python")]
    assert SpecifierSet(PROJECT["requires-python"]).contains(python.partition("=")[2])


def test_condas_environment_holds_the_lock_as_the_virtual_one_does():
    def installs(script: str) -> list[str]:
        lines = (CHECKOUT / script).read_text().replace(".venv/bin/python", "python").splitlines()
        return [line.replace(" --no-build-isolation", "") for line in lines if "torch" in line or "pip install" in line]

    wanted = [line for line in installs("workflow/setup.sh") if not line.startswith("#")]
    assert installs("workflow/envs/polarsim.post-deploy.sh") == wanted
    assert len(wanted) == 5


def test_with_conda_every_job_runs_in_that_one_environment(snakemake, checkout, tmp_path_factory):
    conda = tmp_path_factory.mktemp("bin") / "conda"
    conda.write_text(CONDA)
    conda.chmod(0o755)
    call = ("acquire", "--dry-run", "--sdm", "conda")
    done = snakemake(checkout, *call, PATH=f"{conda.parent}{os.pathsep}{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr[-3000:]
    told = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith("Conda environment")]
    assert told == ["Conda environment workflow/envs/polarsim.yaml will be created."]

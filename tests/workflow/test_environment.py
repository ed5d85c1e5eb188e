"""Environments of the workflow: `.venv`, Conda, and the lock files of both."""

import os
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.version import Version

from polarsim.extras import EXTRA_OF

CHECKOUT = Path(__file__).parents[2]
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
EXTRAS = {  # of the lock files, as in `make lock`
    "requirements.lock": ("cluster", "detect", "pipeline"),
    "requirements-dev.lock": ("cluster", "detect", "dev", "las", "pipeline", "publish", "rover", "taichi"),
}
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


def locked(lock: str) -> dict[str, Version]:
    pins = [Requirement(line) for line in (CHECKOUT / lock).read_text().splitlines()]
    return {pin.name.lower(): Version(str(pin.specifier).removeprefix("==")) for pin in pins}


@pytest.mark.parametrize(
    ("lock", "extra"), [(lock, extra) for lock, extras in EXTRAS.items() for extra in ("", *extras)]
)
def test_a_lock_satisfies_the_requirements_of_the_project(lock, extra):
    asked = PROJECT["optional-dependencies"][extra] if extra else PROJECT["dependencies"]
    pins = locked(lock)
    for requirement in map(Requirement, asked):
        assert requirement.name.lower() in pins, requirement
        assert requirement.specifier.contains(pins[requirement.name.lower()]), requirement


def test_packages_of_the_workflow_have_the_same_versions_in_both_locks():
    workflow, everything = (locked(lock) for lock in EXTRAS)
    assert workflow.items() < everything.items()
    assert {"mujoco", "playwright", "sphinx", "taichi", "usd-core"}.isdisjoint(workflow)


def test_make_lock_locks_these_extras():
    done = subprocess.run(["make", "-n", "lock"], cwd=CHECKOUT, capture_output=True, text=True, check=True)
    calls = [line.split() for line in done.stdout.splitlines() if line.startswith("uv pip compile")]
    found = {call[-1]: {call[place + 1] for place, word in enumerate(call) if word == "--extra"} for call in calls}
    assert found == {lock: set(extras) for lock, extras in EXTRAS.items()}
    assert set(PROJECT["optional-dependencies"]) - set(EXTRAS["requirements-dev.lock"]) == {"mitsuba"}


def test_every_optional_package_names_the_extra_that_installs_it():
    named = {"mcap_ros2": "mcap-ros2-support", "open3d": "open3d-cpu", "pxr": "usd-core", "llvmlite": "numba"}
    for package, extra in EXTRA_OF.items():
        installs = {Requirement(line).name for line in PROJECT["optional-dependencies"][extra]}
        assert named.get(package, package) in installs
    core = {Requirement(line).name for line in PROJECT["dependencies"]}
    assert core.isdisjoint(named.get(package, package) for package in EXTRA_OF)


def test_condas_python_is_one_that_polarsim_runs_on():
    (python,) = [one for one in yaml.safe_load(ENVIRONMENT.read_text())["dependencies"] if one.startswith("python")]
    assert SpecifierSet(PROJECT["requires-python"]).contains(python.partition("=")[2])


def test_condas_environment_holds_the_lock_as_the_virtual_one_does():
    def installs(script: str) -> list[str]:
        lines = (CHECKOUT / script).read_text().replace(".venv/bin/python", "python").splitlines()
        return [line.replace(" --no-build-isolation", "") for line in lines if "torch" in line or "pip install" in line]

    assert "lock=requirements-dev.lock\n" in (CHECKOUT / "workflow/envs/polarsim.post-deploy.sh").read_text()
    wanted = [line for line in installs("workflow/setup.sh") if not line.startswith("#")]
    assert installs("workflow/envs/polarsim.post-deploy.sh") == wanted
    assert len(wanted) == 5


def test_condas_environment_is_installed_from_the_clone_of_the_workflow(tmp_path):
    (tmp_path / "python").write_text('#!/bin/sh\necho "$PWD: $*" >> "$CALLS"\n')
    (tmp_path / "python").chmod(0o755)
    script, environment = ENVIRONMENT.with_suffix(".post-deploy.sh"), {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    refused = subprocess.run(["bash", script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert refused.returncode != 0
    assert "no clone on this machine" in refused.stderr
    environment |= {"CALLS": str(tmp_path / "calls"), "POLARSIM_CLONE": str(CHECKOUT)}
    subprocess.run(["bash", script], cwd=tmp_path, env=environment, check=True)
    calls = (tmp_path / "calls").read_text().splitlines()
    assert all(call.startswith(f"{CHECKOUT}: -m pip install ") for call in calls)
    assert {word for call in calls for word in call.split() if "==" in word} == {
        line.partition(" ;")[0]
        for line in (CHECKOUT / "requirements-dev.lock").read_text().splitlines()
        if "==" in line
    }
    assert calls[-1].endswith("--no-deps --editable .")


def test_with_conda_every_job_runs_in_that_one_environment(snakemake, checkout, tmp_path_factory):
    conda = tmp_path_factory.mktemp("bin") / "conda"
    conda.write_text(CONDA)
    conda.chmod(0o755)
    call = ("acquire", "--dry-run", "--sdm", "conda")
    done = snakemake(checkout, *call, PATH=f"{conda.parent}{os.pathsep}{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr[-3000:]
    told = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith("Conda environment")]
    assert told == ["Conda environment workflow/envs/polarsim.yaml will be created."]

"""Containers are built from the lock file by the script of `make dev`; only Python has a separate version."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RECIPES = {"docker": "containers/Dockerfile", "apptainer": "containers/polarsim.def"}
COPIED = {"docker": "COPY . .", "apptainer": "    . /opt/polarsim"}


@pytest.mark.parametrize("kind", RECIPES)
def test_a_container_installs_exactly_the_packages_of_the_lock(kind):
    lines = (ROOT / RECIPES[kind]).read_text().splitlines()
    commands = [re.sub(r"^(RUN)?\s+", "", line) for line in lines if not line.startswith("#")]
    assert COPIED[kind] in lines  # includes the lock file
    assert "bash workflow/setup.sh python3 requirements-dev.lock" in commands
    assert not [line for line in commands if re.search(r"\bpip\b|==|\bconda\b|\buv\b", line)]
    assert '"$lock"' in (ROOT / "workflow/setup.sh").read_text()


@pytest.mark.parametrize("lock", ["requirements.lock", "requirements-dev.lock"])
def test_a_lock_pins_one_version_of_each_package(lock):
    lines = [line for line in (ROOT / lock).read_text().splitlines() if line and not line.startswith("#")]
    pinned = [re.fullmatch(r"([\w.-]+)==[\w.+]+(?: ;.*)?", line) for line in lines]
    assert all(pinned), [line for line, found in zip(lines, pinned, strict=True) if not found]
    names = [re.sub(r"[._-]+", "-", found[1]).lower() for found in pinned]
    assert len(names) == len(set(names))


def test_both_containers_have_the_same_python_system_and_libraries():
    docker, apptainer = ((ROOT / path).read_text() for path in RECIPES.values())
    base = re.search(r"^FROM (.*)", docker, re.MULTILINE)[1]
    assert re.search(r"^From: (.*)", apptainer, re.MULTILINE)[1] == base
    minor = int(re.match(r"python:3\.(\d+)-", base)[1])
    assert f"Programming Language :: Python :: 3.{minor}" in (ROOT / "pyproject.toml").read_text()
    libraries = re.compile(r"apt-get install .*")
    assert libraries.findall(docker) == libraries.findall(apptainer)


def test_data_and_results_stay_out_of_a_container():
    left_out = (ROOT / ".dockerignore").read_text().split("\n")
    assert {"data", "results", ".git", ".venv", ".snakemake"} <= set(left_out)

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
import yaml
from filelock import FileLock

from polarsim.running import forks
from tests.workflow import forked

CHECKOUT = Path(__file__).parent.parent.parent
SMALL = yaml.safe_load((CHECKOUT / ".test/config/config.yaml").read_text())


def planned(done: subprocess.CompletedProcess) -> dict[str, int]:
    """Return the number of jobs of each rule in a dry-run that succeeded."""
    assert done.returncode == 0, done.stdout + done.stderr
    table = re.search(r"Job stats:\n.*?\n-+ .*?\n(.*?)\n\n", done.stdout + done.stderr, re.DOTALL)
    assert table, done.stdout + done.stderr
    return {name: int(count) for name, count in (line.split() for line in table[1].splitlines())}


def jobs_with(text: str, path: str) -> list[str]:
    """Return the jobs of a plan that read or write a path."""
    return [job for job in re.split(r"\n(?=rule |localrule )", text) if path in job]


@pytest.fixture(scope="session")
def make_checkout() -> Callable[[Path], Path]:
    """Copy all inputs of a run to a folder, without the library, because all tests share its compiled kernels."""

    def make(folder: Path) -> Path:
        shutil.copy(CHECKOUT / "Snakefile", folder)
        for part in ("workflow", "config"):
            shutil.copytree(CHECKOUT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "config/small.yaml").write_text(yaml.safe_dump(SMALL))
        return folder

    return make


@pytest.fixture
def checkout(tmp_path: Path, make_checkout) -> Path:
    """A checkout that a test may change."""
    return make_checkout(tmp_path)


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory) -> Path:
    """The temporary folder of all workers."""
    folder = tmp_path_factory.getbasetemp()
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder


@pytest.fixture(scope="session")
def server_of(shared_folder) -> Callable[[str | None], forked.Server]:
    """Return the server with a `PYTHONHASHSEED`, shared by all workers."""
    owner = os.getppid() if "PYTEST_XDIST_WORKER" in os.environ else os.getpid()
    return cache(lambda hash_seed: forked.Server(shared_folder / f"forked{hash_seed or ''}", owner, hash_seed))


@pytest.fixture
def snakemake_of_commands(server_of, monkeypatch) -> None:
    """Run Snakemake of commands of polarsim, which they start with `sys.executable`, on the server."""
    server = server_of(None)
    server.start()
    monkeypatch.setattr(sys, "executable", str(server.python))
    monkeypatch.setattr(forks, "arguments_of", lambda words: [sys.executable, "-m", "snakemake", *words])


@pytest.fixture(scope="session")
def snakemake(server_of) -> Callable[..., subprocess.CompletedProcess]:
    """Run Snakemake in a folder, with the library of this folder if it has one."""

    def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
        library = folder if (folder / "polarsim").is_dir() else CHECKOUT
        words = ["--cores", "1", *arguments]
        environment = {**os.environ, "PYTHONPATH": str(library), **environment}
        if library == CHECKOUT:
            return server_of(environment.get("PYTHONHASHSEED")).call(folder, words, environment)
        return subprocess.run(
            [sys.executable, "-m", "snakemake", *words],
            cwd=folder, env=environment, capture_output=True, text=True, timeout=forked.LONGEST_S,
        )  # fmt: skip

    return run


@pytest.fixture(scope="session")
def small(shared_folder, make_checkout, snakemake) -> Path:
    """A read-only checkout with a complete run of the pipeline, `config/small.yaml`.

    Shared by all workers: the first worker makes the run, others wait.
    """
    folder = shared_folder / "small"
    failure = folder.with_suffix(".txt")  # a failed run fails for every worker and is not repeated
    with FileLock(folder.with_suffix(".lock")):
        if not folder.exists():
            folder.mkdir()
            done = snakemake(make_checkout(folder), "--cores", "2", "--configfile", "config/small.yaml")
            failure.write_text("" if done.returncode == 0 else f"exit code {done.returncode}\n{done.stderr[-3000:]}")
    assert not failure.read_text(), failure.read_text()
    return folder


@pytest.fixture(scope="session")
def dry_run(tmp_path_factory, make_checkout, snakemake) -> Callable[..., subprocess.CompletedProcess]:
    """Plan the jobs of an unchanged checkout, once per set of arguments.

    The paths in `config/*.yaml` exist: NASA's empty folder, a seed of each terrain, weights.
    """
    folder = make_checkout(tmp_path_factory.mktemp("planned"))
    seeds = [f"data/polar-sim/Labels/Terrain{n:02d}/{n:02d}_A_off_30_L_0256.txt" for n in range(1, 14)]
    for name in ("data/polar/README", "data/weights/yolov5nu.pt", *seeds):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("0 0.5 0.5 0.1 0.1\n")
    known: dict[tuple, subprocess.CompletedProcess] = {}

    def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess:
        call = (arguments, *sorted(environment.items()))
        if call not in known:
            known[call] = snakemake(folder, "--dry-run", *arguments, **environment)
        return known[call]

    return run

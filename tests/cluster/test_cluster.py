"""The workflow with the profiles on a SLURM writes the same bytes as a local run."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from tests.support.made_slurm import CORES, MEMORY_MB
from tests.workflow.conftest import CHECKOUT, SMALL

pytestmark = pytest.mark.cluster

FEW = SMALL | {"positions": ["A"], "detect": {"run": False}, "gap": {}}
LIMIT_S = 1500
# Shorter polling intervals and a smaller node than in the profiles.
HERE = ("--cores", str(CORES), "--resources", f"mem_mb={MEMORY_MB}", "--latency-wait", "10")
POLLS = {
    "slurm": ("--slurm-init-seconds-before-status-checks", "2"),
    "cluster-generic": ("--seconds-between-status-checks", "2"),
}


def digests(checkout: Path) -> dict[str, str]:
    """Return the SHA-256 of every file of a run and of generated data, without logs."""
    return {
        str(path.relative_to(checkout)): hashlib.sha256(path.read_bytes()).hexdigest()
        for part in ("data", "results")
        for path in sorted((checkout / part).rglob("*"))
        if path.is_file() and "logs" not in path.parts
    }


@pytest.fixture(scope="module")
def make_few(make_checkout):
    def make(folder: Path) -> Path:
        make_checkout(folder)
        (folder / "config/few.yaml").write_text(yaml.safe_dump(FEW))
        return folder

    return make


@pytest.fixture(scope="module")
def local(tmp_path_factory, make_few, snakemake) -> dict[str, str]:
    """Digests of a local run."""
    folder = make_few(tmp_path_factory.mktemp("local"))
    done = snakemake(folder, "--cores", str(CORES), "--configfile", "config/few.yaml")
    assert done.returncode == 0, done.stderr[-3000:]
    return digests(folder)


def watched(slurm, folder: Path, *arguments: str) -> str:
    """Run Snakemake; on a timeout or a job that waits forever, end Snakemake and report the queue of SLURM."""
    command = [sys.executable, "-m", "snakemake", *arguments]
    log = folder / "snakemake.log"
    with log.open("w") as out:
        running = subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        end, stuck = time.monotonic() + LIMIT_S, ""
        try:
            while running.poll() is None:
                time.sleep(1)
                stuck = slurm.ask(str(CHECKOUT / "config/profiles/slurm/waiting.sh"))
                assert not stuck, f"waits for ever: {stuck}"
                assert time.monotonic() < end, (
                    f"not done after {LIMIT_S} s:\n{slurm.queue()}\n{log.read_text()[-3000:]}"
                )
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGKILL)
                running.wait()
    assert running.returncode == 0, f"{slurm.queue()}\n{log.read_text()[-5000:]}"
    return log.read_text()


@pytest.mark.parametrize("profile", POLLS)
def test_a_run_on_slurm_has_the_bytes_of_a_local_one(slurm, local, make_few, tmp_path, profile):
    folder = make_few(tmp_path)
    before = len(slurm.ended_jobs())
    call = ("--profile", f"config/profiles/{profile}", *HERE, *POLLS[profile], "--configfile", "config/few.yaml")
    watched(slurm, folder, *call)
    ended = slurm.ended_jobs()[before:]
    assert {job["JobState"] for job in ended} == {"COMPLETED"}
    assert len(ended) <= 10, [job["Name"] for job in ended]
    found = digests(folder)
    assert {name for name in found.keys() | local.keys() if found.get(name) != local.get(name)} == set()
    assert "Nothing to be done" in watched(slurm, folder, *call)

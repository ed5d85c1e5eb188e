"""After SLURM stops a job or the run is killed, the same command writes the same bytes."""

import random
import time
from collections.abc import Callable

import pytest

from benchmarks.chaos import SLURM_KINDS, SlurmSuite
from tests.support.made_slurm import Slurm

pytestmark = pytest.mark.cluster


@pytest.fixture(scope="module")
def suite(slurm, tmp_path_factory) -> SlurmSuite:
    """A workflow of short jobs in three submissions, and the outputs of a local run."""
    return SlurmSuite(tmp_path_factory.mktemp("faults"), random.Random(32), slurm, quick=True)


@pytest.mark.parametrize("kind", SLURM_KINDS)
def test_a_run_whose_job_slurm_stops_ends_with_the_same_bytes(suite, kind):
    suite.disturb(kind)


def test_jobs_that_a_killed_run_left_waiting_are_cancelled(slurm: Slurm, suite):
    suite.clear()
    with slurm.closed():
        process = suite.start()
        until(lambda: len(slurm.ask("squeue", "-h", "-t", "PENDING", "-o", "%i").split()) == 2)
        process.kill()
        process.wait()
        process = suite.start()
        until(lambda: "2 SLURM jobs of an earlier run cancelled" in suite.log.read_text())
    assert process.wait(timeout=300) == 0, suite.said()
    assert (suite.left(), suite.digests()) == ([], suite.expected)


def until(holds: Callable[[], bool]) -> None:
    """Wait until a condition is true."""
    end = time.monotonic() + 120
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.2)

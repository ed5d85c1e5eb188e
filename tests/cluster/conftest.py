"""A SLURM of one node on the loopback interface, only for tests with `-m cluster`."""

from collections.abc import Iterator

import pytest

from tests.support.made_slurm import Slurm, running_slurm, why_not
from tests.workflow.conftest import make_checkout, server_of, shared_folder, snakemake  # noqa: F401 (fixtures)


def pytest_ignore_collect(collection_path, config) -> bool | None:
    """Skip these tests without `-m`: they take minutes and start a service of the machine."""
    return None if "cluster" in (config.getoption("markexpr") or "") else True


@pytest.fixture(scope="session")
def slurm() -> Iterator[Slurm]:
    """A running SLURM; tests are skipped if SLURM cannot be started."""
    if reason := why_not():
        pytest.skip(reason)
    with running_slurm() as own:
        yield own

"""A SLURM of one node on this machine's loopback interface, for the tests of `-m cluster` alone."""

from collections.abc import Iterator

import pytest

from tests.support.made_slurm import Slurm, running_slurm, why_not
from tests.workflow.conftest import make_checkout, snakemake  # noqa: F401 (fixtures)


def pytest_ignore_collect(collection_path, config) -> bool | None:
    """Minutes long, and a service of the whole machine: only where `-m` names them."""
    return None if "cluster" in (config.getoption("markexpr") or "") else True


@pytest.fixture(scope="session")
def slurm() -> Iterator[Slurm]:
    """A running SLURM; tests skip where none can be started."""
    if reason := why_not():
        pytest.skip(reason)
    with running_slurm() as own:
        yield own

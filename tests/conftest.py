import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from polarsim.cli import main

# No limits of time, because busy machines are slow. Deterministic examples: a failure is caused by the tested change;
# `--hypothesis-profile explore` uses random examples.
UNTIMED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("polarsim", derandomize=True, **UNTIMED)
settings.register_profile("explore", **UNTIMED)
settings.load_profile("polarsim")

CHECKOUT = Path(__file__).parent.parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort modules with slow tests to the front, for a better distribution over workers.

    Tests of a module are adjacent, because every worker that runs tests of a module sets up its fixtures.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(autouse=True)
def _thread_limits_stay() -> Iterator[None]:
    """Fail a test that changes a limit of threads, because subprocesses of later tests would inherit it."""
    before = {name: value for name, value in os.environ.items() if "THREADS" in name}
    yield
    assert {name: value for name, value in os.environ.items() if "THREADS" in name} == before


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20170808)


@pytest.fixture(scope="session")
def release_root() -> Path:
    """Root of the published release; skips the test without the release."""
    root = Path(os.environ.get("POLAR_SIM_ROOT", CHECKOUT.parent / "shared" / "polar-sim"))
    if not (root / "Labels").is_dir():
        pytest.skip("no published release: set POLAR_SIM_ROOT to the folder")
    return root


@pytest.fixture
def polarsim(capsys, monkeypatch) -> Callable[..., subprocess.CompletedProcess]:
    """Call the command in this process, which saves the start of Python and imports.

    Exceptions other than `PolarsimError` fail the test with a traceback.
    """

    def call(*arguments: object) -> subprocess.CompletedProcess:
        words = ["polarsim", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", words)
        log = logging.getLogger()
        handlers, level = log.handlers[:], log.level
        try:
            with pytest.raises(SystemExit) as ended:
                main()
        finally:
            log.handlers[:] = handlers
            log.setLevel(level)
        return subprocess.CompletedProcess(words, int(ended.value.code or 0), *capsys.readouterr())

    return call

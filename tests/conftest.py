import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from polarsim.cli import main

# Machines that are busy are slow, so time is for benchmarks. The same examples every time: a check of a change must not
# fail for what somebody else left. `--hypothesis-profile explore` tries other ones.
settings.register_profile("polarsim", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None)
settings.load_profile("polarsim")

CHECKOUT = Path(__file__).parent.parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Modules with slow tests first: the other workers have something to do meanwhile.

    Tests of a module stay together, for workers that share a module each set up what it holds for all its tests.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20170808)


@pytest.fixture(scope="session")
def release_root() -> Path:
    """The published release, where there is one."""
    root = Path(os.environ.get("POLAR_SIM_ROOT", CHECKOUT.parent / "shared" / "polar-sim"))
    if not (root / "Labels").is_dir():
        pytest.skip("the published release is not here: set POLAR_SIM_ROOT to its folder")
    return root


@pytest.fixture
def polarsim(capsys, monkeypatch) -> Callable[..., subprocess.CompletedProcess]:
    """Call the command's entry point within this process: no second start of Python and of what commands import.

    An error that is no `PolarsimError` fails the test with its traceback.
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

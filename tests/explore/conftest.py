import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from .made_run import make_run


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """A run that no test writes to."""
    return make_run(tmp_path_factory.mktemp("results"))


@pytest.fixture(scope="module")
def copied(made, tmp_path_factory) -> Path:
    """Copy of the run (hard links) for corrections of the tests of a module."""
    return shutil.copytree(made, tmp_path_factory.mktemp("copied") / made.name, copy_function=os.link)


@pytest.fixture
def corrected(copied) -> Iterator[Path]:
    """Return a run without corrections; corrections are deleted after the test."""
    yield copied
    shutil.rmtree(copied / "corrections", ignore_errors=True)

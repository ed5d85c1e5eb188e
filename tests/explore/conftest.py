from pathlib import Path

import pytest

from .made_run import make_run


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """A run that no test writes to."""
    return make_run(tmp_path_factory.mktemp("results"))

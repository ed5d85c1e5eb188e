import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("polarsim", deadline=None)  # machines that are busy are slow: time is for benchmarks
settings.load_profile("polarsim")

CHECKOUT = Path(__file__).parent.parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow tests first: the other workers have something to do meanwhile."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


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

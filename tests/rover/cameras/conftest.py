import pytest

from tests.rover import driven


@pytest.fixture(scope="session")
def drive():
    return driven.trace(seconds=3.0)

from pathlib import Path

import pytest

from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, read_catalogue
from polarsim.publish.run import publish
from tests.publish.tiny import make_run


@pytest.fixture(scope="session")
def run(tmp_path_factory) -> Path:
    return make_run(tmp_path_factory.mktemp("tiny"))


@pytest.fixture(scope="session")
def catalogue(run) -> Catalogue:
    return read_catalogue(run)


@pytest.fixture(scope="session")
def published(run, tmp_path_factory):
    """A form's folder, written once for all tests that look at it."""
    out = tmp_path_factory.mktemp("out")

    def folder(form: str) -> Path:
        if not (out / form).exists():
            publish(run, out, [form])
        return out / form

    return folder


@pytest.fixture
def bundle(tmp_path) -> Bundle:
    return Bundle(tmp_path / "bundle")

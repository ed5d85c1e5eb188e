"""A folder with a workflow of short jobs, run by `polarsim run`."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.made_workflow import write_workflow

CHECKOUT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """The workflow and its inputs; the folder name contains a space. Jobs pause so that they can be killed."""
    place = tmp_path / "a run"
    write_workflow(place, pause_s=getattr(request, "param", 0.06))
    return place


@pytest.fixture
def start() -> Callable[..., subprocess.Popen]:
    """Start `polarsim run` in a folder."""

    def call(folder: Path, *words: str, output: int = subprocess.PIPE) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-c", "from polarsim.cli import main; main()", "run", "--min-free", "0", *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
            stdout=output,
            stderr=subprocess.STDOUT,
            text=True,
        )

    return call

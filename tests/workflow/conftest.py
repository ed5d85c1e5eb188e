import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parent.parent.parent
PARTS = ("Snakefile", "workflow", "config", "polarsim")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of everything that a run reads."""
    for part in PARTS:
        source = CHECKOUT / part
        if source.is_dir():
            shutil.copytree(source, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, tmp_path / part)
    return tmp_path


@pytest.fixture
def snakemake() -> Callable[..., subprocess.CompletedProcess]:
    """Run Snakemake in a folder; the library of that folder is the one that counts."""

    def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-m", "snakemake", "--cores", "1", *arguments],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder), **environment},
            capture_output=True,
            text=True,
            timeout=1800,  # one that hangs ends; busy machines are slow
        )

    return run

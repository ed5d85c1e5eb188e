"""The report of a run: made by Snakemake when a table or figure is newer than it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from polarsim.errors import PolarsimError


def make_report(*, run: str, configfile: Path, cores: int = 1, results: Path = Path("results")) -> list[Path]:
    """Make `results/<run>/report.html` if it is out of date; return the tables and the report.

    Raises
    ------
    PolarsimError
        The run has no tables yet, or Snakemake cannot make the report.
    """
    folder = results / run
    parts = sorted([*folder.glob("tables/*.*"), *folder.glob("figures/*.png")])
    if not parts:
        raise PolarsimError("no tables; run snakemake first", path=folder)
    page = folder / "report.html"
    if not page.exists() or page.stat().st_mtime < max(path.stat().st_mtime for path in parts):
        command = [
            *(sys.executable, "-m", "snakemake", "--cores", str(cores)),
            *("--configfile", str(configfile), "--report", str(page)),
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise PolarsimError(f"snakemake --report failed: {' '.join(done.stderr.split())[-500:]}", path=page)
    return [*(path for path in parts if path.suffix == ".md"), page]

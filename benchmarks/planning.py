"""Time that Snakemake takes to plan a run of all 13 terrains, two splits and three seeds, beside that of the demo.

    python benchmarks/planning.py

A dry-run reads the configuration, names all files and builds the graph of jobs; nothing is made.

Last metrics (AMD EPYC, two cores, other work running): demo 11.6 s, 13 terrains 14.7 s, ratio 1.3.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]


def seconds_of(configuration: Path) -> float:
    """Wall time of one dry-run, s."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "snakemake", "--dry-run", "--quiet", "all", "--configfile", str(configuration)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return time.perf_counter() - start


def main() -> None:
    """Print both times and their ratio."""
    demo = ROOT / "config/config.yaml"
    content = yaml.safe_load(demo.read_text())
    content.update(run="planned", terrains=list(range(1, 14)), positions=list("ABCDEFG"), grid={})
    content["detect"] |= {"splits": ["photo", "terrain"], "seeds": [0, 1, 2]}
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "all.yaml"
        whole.write_text(yaml.safe_dump(content))
        small, large = seconds_of(demo), seconds_of(whole)
    print(f"demo {small:.1f} s, 13 terrains {large:.1f} s, ratio {large / small:.1f}")


if __name__ == "__main__":
    main()

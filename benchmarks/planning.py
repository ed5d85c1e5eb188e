"""Time that Snakemake needs to plan runs, and to detect that a finished run is complete.

    python benchmarks/planning.py

A dry-run reads the configuration, names all files and builds the graph of jobs without executing them. "Finished" is
the same configuration in a separate folder with empty files that Snakemake treats as outputs (`snakemake --touch`). CPU
time is printed next to wall time, because machines are busy.

Last metrics (AMD EPYC, two cores at a load of 13): demo 17.3 s, 3.1 s of CPU; full (334 jobs) 19.8 s, 3.7; 13 terrains
with 18 trainings 18.9 s, 3.8; full finished 11.7 s, 3.2.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]


def snakemake(folder: Path, configuration: Path, *arguments: str) -> tuple[str, float, float]:
    """Return Snakemake's output, its wall time and its CPU time, s."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-m", "snakemake", "--cores", "1", *arguments, "--configfile", str(configuration)]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout + done.stderr, wall, cpu


def with_detectors(folder: Path) -> Path:
    """Write the demo's configuration with all 13 terrains and photos, two splits and three seeds."""
    content = yaml.safe_load((ROOT / "config/config.yaml").read_text())
    content.update(run="planned", terrains=list(range(1, 14)), positions=list("ABCDEFG"), grid={})
    content["detect"] |= {"splits": ["photo", "terrain"], "seeds": [0, 1, 2]}
    path = folder / "detectors.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def finish(folder: Path, configuration: Path) -> int:
    """Create an empty file or folder for each output, mark all as complete, and return their number."""
    summary = snakemake(folder, configuration, "--summary")[0]
    outputs = [Path(line.split("\t")[0]) for line in summary.splitlines() if line.startswith(("results/", "data/"))]
    for path in outputs:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).touch() if path.suffix else (folder / path).mkdir(exist_ok=True)
    snakemake(folder, configuration, "--touch", "--quiet", "all")
    return len(outputs)


def main() -> None:
    """Print the times."""
    full = ROOT / "config/full.yaml"
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        shutil.copy(ROOT / "Snakefile", folder)
        for part in ("workflow", "config"):
            shutil.copytree(ROOT / part, folder / part)
        runs = {"demo": ROOT / "config/config.yaml", "full": full, "13 terrains, 18 trainings": with_detectors(folder)}
        for name, configuration in runs.items():
            _, wall, cpu = snakemake(folder, configuration, "--dry-run", "--quiet", "all")
            print(f"{name}: planned in {wall:.1f} s, {cpu:.1f} s of CPU")
        outputs = finish(folder, full)
        told, wall, cpu = snakemake(folder, full)
        assert "Nothing to be done" in told, told
        print(
            f"full, its {outputs} files and folders finished: nothing to be done after {wall:.1f} s, {cpu:.1f} s of CPU"
        )


if __name__ == "__main__":
    main()

"""What a run took: jobs, CPU and wall time, memory and bytes written by rule, and the disk of each of its folders.

    python benchmarks/run_costs.py results/full [data/full]

Snakemake's benchmark files below `results/<run>/benchmarks` are read, one a job. The tables are Markdown; those of
config/full.yaml stand in docs/howto/cluster.md.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[1]
MB = 1e6


def rules() -> list[str]:
    """Names of all rules, long ones first, so that the first that a file's name starts with is its rule."""
    text = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    named = re.findall(r"rule (\w+):|use rule \w+ as (\w+)", text)
    return sorted({first or second for first, second in named}, key=len, reverse=True)


def job_costs(run: Path) -> pd.DataFrame:
    """One row a job: its rule, seconds of wall and CPU, MB of memory at the most, MB written.

    Raises
    ------
    SystemExit
        The run has no benchmark files.
    """
    files = sorted((run / "benchmarks").rglob("*.tsv"))
    if not files:
        raise SystemExit(f"{run}/benchmarks: no benchmark files")
    known = rules()
    rows = pd.concat([pd.read_csv(file, sep="\t", na_values="-").assign(file=file.stem) for file in files])
    rows["rule"] = [next(rule for rule in known if f"{name}_".startswith(f"{rule}_")) for name in rows["file"]]
    return rows[["rule", "s", "cpu_time", "max_rss", "io_out"]]


def rule_costs(jobs: pd.DataFrame) -> pd.DataFrame:
    """One row a rule, the costliest first."""
    table = jobs.groupby("rule").agg(
        jobs=("s", "size"),
        cpu_s=("cpu_time", "sum"),
        wall_s=("s", "sum"),
        peak_mb=("max_rss", "max"),
        written_mb=("io_out", "max"),
    )
    return table.sort_values("cpu_s", ascending=False).round(1)


def disk(folder: Path, depth: int = 2, least_mb: float = 1) -> dict[str, float]:
    """MB of every folder down to a depth that holds anything to speak of; a file of several names by its first."""
    sizes: dict[str, float] = {}
    seen: set[int] = set()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink() and (number := path.stat().st_ino) not in seen:
            seen.add(number)
            parts = path.relative_to(folder).parts[:-1]
            for n in range(min(len(parts), depth) + 1):
                name = "/".join(parts[:n]) or "."
                sizes[name] = sizes.get(name, 0) + path.stat().st_size / MB
    return {name: round(size, 1) for name, size in sorted(sizes.items()) if size >= least_mb}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="folder of the run, results/<run>")
    parser.add_argument("data", type=Path, nargs="*", help="further folders whose sizes are told")
    chosen = parser.parse_args()
    jobs = job_costs(chosen.run)
    print("| rule | jobs | CPU s | wall s | peak MB | written MB, at most |\n|---|---|---|---|---|---|")
    for rule, row in rule_costs(jobs).iterrows():
        print(f"| `{rule}` | {row.jobs:.0f} | {row.cpu_s} | {row.wall_s} | {row.peak_mb:.0f} | {row.written_mb:.0f} |")
    print(f"| all | {len(jobs)} | {jobs.cpu_time.sum():.0f} | {jobs.s.sum():.0f} | {jobs.max_rss.max():.0f} | |\n")
    for folder in (chosen.run, *chosen.data):
        print(f"| {folder} | MB |\n|---|---|")
        for name, size in disk(folder).items():
            print(f"| `{name}` | {size} |")
        print()


if __name__ == "__main__":
    main()

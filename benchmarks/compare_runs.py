"""Compare all files of two runs below results/<run>, by bytes or by content.

    python benchmarks/compare_runs.py BEFORE AFTER [--renamed OLD=NEW ...] [--without FOLDER ...]

For changes of the code that must not change outputs: labels, meshes and renders must keep their bytes, tables must be
equal except for the configuration's digest, and pictures must have the same pixels. `--renamed` lists words that
changed in paths, columns and cells. Logs, times and pages (html, md, tex, which repeat tables) are skipped. The script
prints a line for each folder and each file that differs, and exits with 1 if a file differs.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import png

LEFT_OUT = ("logs", "benchmarks")
REPEATED = (".html", ".md", ".tex")
DIGESTS = ("config", "code", "digest")  # columns and keys that depend on options and code


def comparable(folder: Path, without: tuple[str, ...]) -> dict[str, Path]:
    """Return the files of a run by their path below it."""
    return {
        name: path
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and (name := str(path.relative_to(folder))).split("/")[0] not in (*LEFT_OUT, *without)
        and path.suffix not in REPEATED
        and not path.name.startswith(".")
    }


def renaming(pairs: dict[str, str]) -> Callable[[str], str]:
    """Return a function that replaces old by new words, as entire words or parts between underscores."""
    if not pairs:
        return lambda text: text
    pattern = re.compile("|".join(rf"(?<![A-Za-z]){re.escape(old)}(?![a-z])" for old in pairs))
    return lambda text: pattern.sub(lambda found: pairs[found[0]], text)


def content(path: Path, renamed: Callable[[str], str]) -> Any:
    """Return the content of a file independent of its format: columns, a tree of values, pixels, lines or bytes."""
    if path.suffix in (".parquet", ".csv"):
        table = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path, dtype=str)
        table = table.drop(columns=[name for name in DIGESTS if name in table])
        return [(renamed(str(name)), [renamed(repr(cell)) for cell in column]) for name, column in table.items()]
    if path.suffix == ".json":
        return _without_digests(json.loads(renamed(path.read_text())))
    if path.suffix == ".png":
        return png.read_png(path).tolist()
    if path.suffix in (".txt", ".obj", ".ply", ".yaml"):
        return renamed(path.read_bytes().decode("latin-1"))
    if path.suffix == ".npz":
        return {name: array.tolist() for name, array in np.load(path).items()}
    return path.read_bytes()


def _without_digests(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_digests(one) for key, one in value.items() if key not in DIGESTS}
    return [_without_digests(one) for one in value] if isinstance(value, list) else value


def main() -> int:
    """Compare, print, and return the exit code."""
    parser = argparse.ArgumentParser(description="Compare the files of two runs.")
    parser.add_argument("before", type=Path, help="results/<run> of the previous state")
    parser.add_argument("after", type=Path, help="results/<run> of the new state")
    parser.add_argument("--renamed", nargs="*", default=[], metavar="OLD=NEW", help="words that changed")
    parser.add_argument("--without", nargs="*", default=[], metavar="FOLDER", help="folders of the run to skip")
    asked = parser.parse_args()
    renamed = renaming(dict(pair.split("=", 1) for pair in asked.renamed))
    before = {renamed(name): path for name, path in comparable(asked.before, tuple(asked.without)).items()}
    after = comparable(asked.after, tuple(asked.without))
    counts: Counter[tuple[str, str]] = Counter()
    for name in sorted({*before, *after}):
        folder = name.split("/")[0]
        if name not in before or name not in after:
            outcome = "only after" if name in after else "only before"
        elif before[name].read_bytes() == after[name].read_bytes():
            outcome = "same bytes"
        else:
            outcome = "says the same" if content(before[name], renamed) == content(after[name], str) else "differs"
        counts[folder, outcome] += 1
        if outcome not in ("same bytes", "says the same"):
            print(f"{outcome}: {name}")
    for (folder, outcome), count in sorted(counts.items()):
        print(f"{folder}: {count} files {outcome}")
    return int(any(outcome in ("differs", "only before", "only after") for _, outcome in counts))


if __name__ == "__main__":
    sys.exit(main())

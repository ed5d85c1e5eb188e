"""Learning curves of every detector of runs against CPU time: mAP@0.5 on what chooses its weights, an epoch a point.

.venv/bin/python benchmarks/learning_curves.py results/demo [results/OTHER ...] --figure curves.png

A training's CPU time is that of its job (Snakemake's benchmark file), shared out evenly to its epochs; one that was
stopped and went on counts its last part alone.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import matplotlib as mpl
import pandas as pd

mpl.use("Agg")
import matplotlib.pyplot as plt

# A curve's path below the run, its job's benchmark file below `benchmarks`, the name that the figure gives to curves
# that differ in the seed alone, and that seed. The first pattern counts.
PLACES = (
    (
        r"detect/(\w+)/seed(\d+)/detectors/(\w+)\.csv",
        r"detect/train_detector_\1_seed\2_\3.tsv",
        r"\3, split by \1",
        r"\2",
    ),
    (
        r"detect/(\w+)/others/([\w-]+)/seed(\d+)/detectors/(\w+)\.csv",
        r"detect/train_other_detector_\1_\2_seed\3_\4.tsv",
        r"\2 on \4, split by \1",
        r"\3",
    ),
    (
        r"covers/folds/(carved)/seed(\d+)/rendered/detector\.csv",
        r"covers/train_cover_detector_\1_seed\2.tsv",
        r"scenes of carved rocks",
        r"\2",
    ),
    (
        r"covers/folds/(all)/seed(\d+)/rendered/detector\.csv",
        r"covers/train_cover_detector_\1_seed\2.tsv",
        r"scenes of all terrains",
        r"\2",
    ),
    (
        r"covers/folds/(all)/seed(\d+)/fine_tuned/detector\.csv",
        r"covers/fine_tune_cover_detector_\1_seed\2.tsv",
        r"then photos of all terrains",
        r"\2",
    ),
    (
        r"covers/folds/(\w+)/seed(\d+)/rendered/detector\.csv",
        r"covers/train_cover_detector_\1_seed\2.tsv",
        r"scenes without terrains \1",
        r"\2",
    ),
    (
        r"covers/folds/(\w+)/seed(\d+)/fine_tuned/detector\.csv",
        r"covers/fine_tune_cover_detector_\1_seed\2.tsv",
        r"then photos without terrains \1",
        r"\2",
    ),
    (r"(rover)/fine_tuned\.csv", r"rover/fine_tune_on_drives.tsv", r"pictures of drives", "0"),
)


def curves(run: Path) -> dict[tuple[str, str], pd.DataFrame]:
    """By name and seed: cpu_min since the start of a training, and val_map50, a row an epoch."""
    found = {}
    for path in sorted(run.rglob("*.csv")):
        place = path.relative_to(run).as_posix()
        for pattern, benchmark, name, seed in PLACES:
            if match := re.fullmatch(pattern, place):
                costs = run / "benchmarks" / match.expand(benchmark)
                curve = pd.read_csv(path)
                minutes = pd.read_csv(costs, sep="\t")["cpu_time"].sum() / 60
                found[match.expand(name), match.expand(seed)] = pd.DataFrame(
                    {"cpu_min": minutes * curve["epoch"] / curve["epoch"].max(), "val_map50": curve["val_map50"]}
                )
                break
    if not found:
        raise SystemExit(f"{run}: no learning curves")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN")
    parser.add_argument("--figure", type=Path, required=True)
    asked = parser.parse_args()
    several = len(asked.runs) > 1
    found = {
        (f"{run.name}: {name}" if several else name, seed): curve
        for run in asked.runs
        for (name, seed), curve in curves(run).items()
    }
    names = list(dict.fromkeys(name for name, _ in found))
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for (name, seed), curve in found.items():
        colour = plt.get_cmap("tab20").colors[names.index(name) % 20]
        first = seed == min(one for other, one in found if other == name)
        style = {"marker": "os^D"[int(seed) % 4], "markersize": 3, "linewidth": 1, "linestyle": "-" if first else "--"}
        axes.plot(curve["cpu_min"], curve["val_map50"], color=colour, label=name if first else None, **style)
        values = " ".join(f"{value:.3f}" for value in curve["val_map50"])
        print(f"{name}, seed {seed}: {curve['cpu_min'].iloc[-1]:.1f} CPU minutes, {values}")
    axes.set(
        xlabel="CPU time of the training, minutes; seeds after the first are dashed",
        ylabel="mAP@0.5 on pictures that choose the weights",
        ylim=(0, None),
        xlim=(0, None),
    )
    axes.legend(fontsize=7)
    figure.savefig(asked.figure, dpi=110)


if __name__ == "__main__":
    main()

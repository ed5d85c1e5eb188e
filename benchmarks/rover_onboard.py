"""Rock cells and false stops on board over terrains of the release that the detector has seen nothing of.

    python benchmarks/rover_onboard.py results/covers [--cores 2]

`results/covers` is a finished run of `snakemake real --configfile config/covers.yaml`. Each fold's detector goes on
with drives over the other folds' terrains (`rover.fine_tuning`, two seeds, Suns 1 and 3), then looks through the front
camera in drives over its own terrains (two seeds, all four Suns). All is made by the workflow, in runs `drives_FOLD`
and `onboard_FOLD`; what is there stays. The table is Markdown; it stands in docs/notes/rover.md.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from polarsim.report.seeds import with_interval
from polarsim.rover.vehicle.mounts import FRONT
from polarsim.schemas import FINE_TUNED

CONFIG = Path(__file__).parents[1] / "config"
RESULTS = Path("results")
SEEDS = (0, 1)
TRAINED_SUNS, TESTED_SUNS = ("1", "3"), ("1", "2", "3", "4")
LOOK_PX = 960  # as packaged_rover looks: a picture's whole width
METRICS = ("rock cell F1", "false stops per 100 m")


def configuration(run: str, terrains: list[int], suns: tuple[str, ...]) -> dict[str, Any]:
    """A run that drives over terrains of the release, front camera at half size."""
    content = yaml.safe_load((CONFIG / "rover_release.yaml").read_text()) | {"run": run, "terrains": terrains}
    cameras = {"views": [FRONT], "suns": list(suns), "models": ["hapke"], "exposures_ms": [256], "scale": 0.5}
    content["rover"] |= {
        "bags": False,
        "seeds": list(SEEDS),
        "world": {"terrains": terrains},
        "drive": {"picture_hz": 2},
        "cameras": cameras,
    }
    return content


def make(chosen: dict[str, Any], targets: list[str], cores: int) -> None:
    """Let the workflow make files of a run."""
    file = RESULTS / chosen["run"] / "config.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(yaml.safe_dump(chosen, sort_keys=False))
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores), "--rerun-incomplete"]
    subprocess.run([*command, "--configfile", str(file), "--", *targets], check=True)


def drives_of(fold: str) -> list[str]:
    """Folders of the drives over a fold's terrains that other folds' detectors are trained on."""
    return [f"results/drives_{fold}/rover/seed{seed}" for seed in SEEDS]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("covers", type=Path, help="folder of a finished run of `snakemake real`")
    parser.add_argument("--cores", type=int, default=2)
    asked = parser.parse_args()
    detectors = {
        path.parents[2].name: path
        for path in sorted(asked.covers.glob(f"covers/folds/*/seed0/{FINE_TUNED}/detector.pt"))
        if re.fullmatch(r"\d\d(_\d\d)*", path.parents[2].name)
    }
    if len(detectors) < 2:
        raise SystemExit(f"{asked.covers}: expected detectors of two folds or more in covers/folds")
    terrains = {fold: [int(terrain) for terrain in fold.split("_")] for fold in detectors}
    for fold in detectors:
        chosen = configuration(f"drives_{fold}", terrains[fold], TRAINED_SUNS)
        make(chosen, [f"{drive}/{FRONT}/poses.parquet" for drive in drives_of(fold)], asked.cores)
    rows = {}
    for fold, weights in detectors.items():
        chosen = configuration(f"onboard_{fold}", terrains[fold], TESTED_SUNS)
        chosen["rover"]["cameras"]["onboard"] = {"weights": str(weights), "prediction": {"widths": [LOOK_PX]}}
        others = [drive for other in detectors if other != fold for drive in drives_of(other)]
        chosen["rover"]["fine_tuning"] = {"drives": others}
        table = f"results/onboard_{fold}/rover/onboard.parquet"
        make(chosen, [table], asked.cores)
        rows[", ".join(map(str, terrains[fold]))] = told(pd.read_parquet(table))
    print(pd.DataFrame(rows).T.rename_axis("terrains left out").to_markdown())


def told(table: pd.DataFrame) -> dict[str, str]:
    """The figures of labels, of labels that stand out and of the detector, with intervals."""
    rows = table[(table["exposure_ms"] > 0) & table["metric"].isin(METRICS)]
    rows = rows.rename(columns={"low": "value_low", "high": "value_high"})
    names = rows["source"] + ": " + rows["metric"]
    return dict(zip(names, [with_interval(row, "value") for _, row in rows.iterrows()], strict=True))


if __name__ == "__main__":
    main()

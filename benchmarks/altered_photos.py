"""What `polarsim detect` finds in cover photos that are not as published: smaller, darker, noisy, upside down.

    python benchmarks/altered_photos.py results/covers [--seeds 0 1]

`results/covers` is a finished run of `snakemake real --configfile config/covers.yaml`. Each fold's fine-tuned detector
looks at the photos of its own terrains through the command line, mirrored too, at the widths and the gate that the
stage chose for its rocks; boxes are brought back to the published photo and scored against its labels. No camera is
known there, so finds off the sand count as false ones. The table is Markdown; it stands in docs/notes/detect.md.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from polarsim.cover_photos.scores import cover_figures
from polarsim.detect.detect_pictures import read_any
from polarsim.photo import ROCK
from polarsim.report.seeds import with_interval
from polarsim.schemas import FINE_TUNED

RESAMPLES = 500
UPSIDE_DOWN, NO_WIDTHS = "upside down", "as published, no widths given"


def smaller(times: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda photo: cv2.resize(photo, None, fx=1 / times, fy=1 / times, interpolation=cv2.INTER_AREA)


def as_jpeg(photo: np.ndarray) -> np.ndarray:
    content = cv2.imencode(".jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, 15])[1]
    return np.asarray(cv2.imdecode(content, cv2.IMREAD_GRAYSCALE))


def noisy(photo: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(0).normal(0, 15, photo.shape)
    return np.clip(photo + noise, 0, 255).astype(np.uint8)


ALTERED: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "as published": lambda photo: photo,
    "half their size": smaller(2),
    "a quarter of it": smaller(4),
    "JPEG of quality 15": as_jpeg,
    "noise, standard deviation 15 of 255": noisy,
    "a quarter as bright (8 bits)": lambda photo: photo // 4,
    "an eighth as bright (8 bits)": lambda photo: photo // 8,
    UPSIDE_DOWN: lambda photo: photo[::-1, ::-1],
    NO_WIDTHS: lambda photo: photo,
}


def found_in(name: str, photos: list[Path], weights: Path, looks: list[str], work: Path) -> pd.DataFrame:
    """Finds in altered photos, in pixels of the published ones: a row a box."""
    sizes = {}
    work.mkdir(parents=True)
    for path in photos:
        published = read_any(path)
        altered = ALTERED[name](published)
        cv2.imwrite(str(work / path.name), altered)
        sizes[path.name] = published.shape, altered.shape
    out = work.with_name(f"{work.name}_found")
    polarsim = Path(sys.executable).with_name("polarsim")  # the command of this environment
    command = [str(polarsim), "detect", str(work), "--weights", str(weights), "--device", "cpu"]
    command += ["--confidence", "0.01", "--no-draw", "--out", str(out), *looks]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    found = pd.read_csv(out / "detections.csv")
    for low, high, axis in (("x0", "x1", 1), ("y0", "y1", 0)):
        published_px, altered_px = (
            np.array([sizes[picture][which][axis] for picture in found["picture"]]) for which in (0, 1)
        )
        found[[low, high]] = found[[low, high]].mul(published_px / altered_px, axis=0)
        if name == UPSIDE_DOWN:
            found[low], found[high] = published_px - found[high], published_px - found[low]
    return found.assign(key=[Path(picture).stem for picture in found["picture"]])


def figures(covers: Path, name: str, seeds: list[int]) -> dict[str, str]:
    """Rocks and shadows found in all photos, altered so."""
    photos = sorted((covers / "photos").glob("*.png"))
    tables = []
    for seed in seeds:
        trained = covers / FINE_TUNED / f"seed{seed}"
        sizes = pd.read_csv(trained / "sizes.csv", dtype=str).set_index("fold")
        found = []
        for fold, row in sizes[sizes["kind"] == ROCK].iterrows():
            own = [path for path in photos if path.name[:2] in str(fold).split("_")]
            widths = ["--widths", row["widths"].replace(" ", ","), "--gates", row["gates_px"].replace(" ", ",")]
            looks = [] if name == NO_WIDTHS else ["--mirrored", *widths]
            weights = covers / "folds" / str(fold) / f"seed{seed}" / FINE_TUNED / "detector.pt"
            with tempfile.TemporaryDirectory() as work:
                found.append(found_in(name, own, weights, looks, Path(work) / "altered"))
        tables.append(pd.concat(found))
    scored = cover_figures(
        pd.read_parquet(covers / "labels.parquet"), tables, [p.stem for p in photos], seed=0, resamples=RESAMPLES
    )
    return {row["kind"]: with_interval(row, "map50") for _, row in scored.iterrows()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a finished run of `snakemake real`")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    asked = parser.parse_args()
    if not (asked.run / "covers" / FINE_TUNED).is_dir():
        raise SystemExit(f"{asked.run}: expected a finished run of `snakemake real`")
    rows = {}
    for name in ALTERED:
        rows[name] = figures(asked.run / "covers", name, asked.seeds)
        print(name, rows[name], flush=True)
    print(pd.DataFrame(rows).T.rename_axis("mAP@0.5").to_markdown())


if __name__ == "__main__":
    main()

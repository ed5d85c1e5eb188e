"""Weights of the run's detectors, each with a model card."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from polarsim import __version__
from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet
from polarsim.publish import terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue

_SCORES = ("trained", "split", "seed", "evaluated", "kind", "images", "labels", "shares_views")
_FACTS = ("detector", "start", "epochs", "imgsz")
_INTERVALS = {"map50": "mAP@0.5", "map50_95": "mAP@[0.5:0.95]"}
_COMPACT = "compact"  # start of the names of polarsim's detectors; all other detectors are Ultralytics models


@dataclass(frozen=True)
class Weights:
    """Weights file of a detector with split, seed and training domain."""

    path: Path
    split: str
    seed: int
    trained: str

    @property
    def name(self) -> str:
        """Path in the bundle, without suffix."""
        return f"{self.split}/seed{self.seed}/{self.trained}"


def detectors(catalogue: Catalogue) -> Iterator[Weights]:
    """Yield the detectors of the run, sorted by name."""
    for path in sorted((catalogue.run / "detect").glob("*/seed*/detectors/*.pt")):
        split, seed = path.parts[-4], path.parts[-3].removeprefix("seed")
        yield Weights(path, split, int(seed), path.stem)


def write_detectors(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<split>/seedN/<domain>.pt` and `<domain>.md`."""
    table = catalogue.run / "detect" / "detection.parquet"
    columns = [*_SCORES, *_FACTS, *(f"{name}{end}" for name in _INTERVALS for end in ("", "_low", "_high"))]
    scores = read_parquet(table, columns) if table.is_file() else pd.DataFrame(columns=columns)
    for detector in detectors(catalogue):
        bundle.copy(f"{detector.name}.pt", detector.path)
        rows = scores[
            (scores["trained"] == detector.trained)
            & (scores["split"] == detector.split)
            & (scores["seed"] == detector.seed)
        ]
        bundle.text(f"{detector.name}.md", _card(catalogue, detector, rows))


def _card(catalogue: Catalogue, weights: Weights, scores: pd.DataFrame) -> str:
    """Return the model card in Markdown."""
    parts = [
        f"# Detector of rocks and shadows, trained on {weights.trained}",
        f"Run `{catalogue.name}` (source `{catalogue.kind}`, configuration `{catalogue.config or 'unknown'}`), "
        f"photos split by {weights.split}, seed {weights.seed}; polarsim {__version__}.",
        f"Usage: `polarsim detect PICTURES --weights {weights.trained}.pt --out FOLDER`. The file contains tensors and "
        "plain values, no code.",
        _training(catalogue, weights, scores),
        _evaluation(scores),
        "The test images show the same sandbox with the same lamps; results may not transfer to other scenes.",
        _licence(catalogue, weights, scores),
    ]
    return "\n\n".join(parts) + "\n"


def _training(catalogue: Catalogue, weights: Weights, scores: pd.DataFrame) -> str:
    parts = []
    if len(scores):
        facts = scores.iloc[0]
        parts.append(
            f"**Training**: {facts['detector']}, start {facts['start']}, epochs {facts['epochs']}, image width "
            f"{facts['imgsz']} px."
        )
    dataset = catalogue.run / "detect" / weights.split / "datasets" / weights.trained / "dataset.json"
    if dataset.is_file():
        counts = read_json(dataset)["pictures"]
        parts.append(f"**Data**: {counts['train']} images for training, {counts['val']} for the choice of weights.")
    return " ".join(parts) or "The training is not documented: the run has no table of scores."


def _evaluation(scores: pd.DataFrame) -> str:
    if not len(scores):
        return "Not evaluated."
    lines = [
        "95 % intervals in brackets.",
        "",
        f"| evaluated on | class | images | labels | {' | '.join(_INTERVALS.values())} |",
        "|---|---|---|---|---|---|",
    ]
    for row in scores.to_dict("records"):
        cells = [f"{row[name]:.3f} [{row[f'{name}_low']:.3f}, {row[f'{name}_high']:.3f}]" for name in _INTERVALS]
        subject = (row["evaluated"], row["kind"], row["images"], row["labels"])
        lines.append(f"| {' | '.join(map(str, subject))} | {' | '.join(cells)} |")
    if scores["shares_views"].any():
        lines += ["", "Training and test share views in different light; scores on new views are lower."]
    return "\n".join(lines)


def _licence(catalogue: Catalogue, weights: Weights, scores: pd.DataFrame) -> str:
    text = "**Licence**: BSD-3-Clause, the licence of the code."
    if len(scores) and not str(scores["detector"].iloc[0]).startswith(_COMPACT):
        text = (
            "**Licence**: AGPL-3.0, required by Ultralytics for its models, for models trained with its code, and for "
            "software that loads them."
        )
    return text + (terms.source_of_training(catalogue) if weights.trained == "real" else "")

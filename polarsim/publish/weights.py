"""The run's detectors: weights as they were trained, each with a card of what it is and of its scores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from polarsim import __version__
from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue

_SCORES = ("trained", "split", "seed", "evaluated", "kind", "images", "labels", "leaks_views")
_FACTS = ("detector", "start", "epochs", "imgsz")
_INTERVALS = {"map50": "mAP@0.5", "map50_95": "mAP@[0.5:0.95]"}
_OWN = "compact"  # families of other names are Ultralytics'


@dataclass(frozen=True)
class Weights:
    """A detector's file: how the photos were split, the training's seed, and the domain that it was trained on."""

    path: Path
    split: str
    seed: int
    trained: str

    @property
    def name(self) -> str:
        """Path in the bundle, without an ending."""
        return f"{self.split}/seed{self.seed}/{self.trained}"


def found(catalogue: Catalogue) -> Iterator[Weights]:
    """The detectors of the run, sorted by name."""
    for path in sorted((catalogue.run / "detect").glob("*/seed*/detectors/*.pt")):
        split, seed = path.parts[-4], path.parts[-3].removeprefix("seed")
        yield Weights(path, split, int(seed), path.stem)


def lacking(catalogue: Catalogue) -> str:
    return "" if any(found(catalogue)) else "the run has no detectors (target `detect`)"


def fixed_bytes(catalogue: Catalogue) -> int:
    return sum(one.path.stat().st_size for one in found(catalogue))


def write(catalogue: Catalogue, bundle: Bundle) -> None:
    """`<split>/seedN/<domain>.pt` and beside it `<domain>.md`."""
    table = catalogue.run / "detect" / "detection.parquet"
    columns = [*_SCORES, *_FACTS, *(f"{name}{end}" for name in _INTERVALS for end in ("", "_low", "_high"))]
    scores = read_parquet(table, columns) if table.is_file() else pd.DataFrame(columns=columns)
    for one in found(catalogue):
        bundle.copy(f"{one.name}.pt", one.path)
        own = scores[(scores["trained"] == one.trained) & (scores["split"] == one.split) & (scores["seed"] == one.seed)]
        bundle.text(f"{one.name}.md", _card(catalogue, one, own))


def _card(catalogue: Catalogue, weights: Weights, scores: pd.DataFrame) -> str:
    """Markdown."""
    parts = [
        f"# Detector of rocks and shadows, trained on {weights.trained}",
        f"Of run `{catalogue.name}` (source `{catalogue.kind}`, configuration `{catalogue.config or 'unknown'}`), "
        f"photos split by {weights.split}, seed {weights.seed}; polarsim {__version__}.",
        f"`polarsim detect PICTURES --weights {weights.trained}.pt --out FOLDER` uses it. The file holds tensors and "
        "plain values, nothing that runs when it is read.",
        _made(catalogue, weights, scores),
        _scored(scores),
        "Tested on pictures of the same sandbox under the same lamps: nothing here says how it does elsewhere.",
        _licence(weights, scores),
    ]
    return "\n\n".join(parts) + "\n"


def _made(catalogue: Catalogue, weights: Weights, scores: pd.DataFrame) -> str:
    said = []
    if len(scores):
        facts = scores.iloc[0]
        said.append(
            f"**Training**: {facts['detector']}, start {facts['start']}, epochs {facts['epochs']}, pictures "
            f"{facts['imgsz']} px wide."
        )
    dataset = catalogue.run / "detect" / weights.split / "datasets" / weights.trained / "dataset.json"
    if dataset.is_file():
        counts = read_json(dataset)["pictures"]
        said.append(f"**Data**: {counts['train']} pictures to train on, {counts['val']} to choose the weights by.")
    return " ".join(said) or "How it was trained is not known: the run has no table of scores."


def _scored(scores: pd.DataFrame) -> str:
    if not len(scores):
        return "It was not evaluated."
    lines = [
        "95 % intervals in brackets.",
        "",
        f"| evaluated on | class | pictures | labels | {' | '.join(_INTERVALS.values())} |",
        "|---|---|---|---|---|---|",
    ]
    for row in scores.to_dict("records"):
        cells = [f"{row[name]:.3f} [{row[f'{name}_low']:.3f}, {row[f'{name}_high']:.3f}]" for name in _INTERVALS]
        named = (row["evaluated"], row["kind"], row["images"], row["labels"])
        lines.append(f"| {' | '.join(map(str, named))} | {' | '.join(cells)} |")
    if scores["leaks_views"].any():
        lines += ["", "Views that were tested were trained on too, under other light: other views score lower."]
    return "\n".join(lines)


def _licence(weights: Weights, scores: pd.DataFrame) -> str:
    said = "**Licence**: BSD-3-Clause, as the code."
    if len(scores) and not str(scores["detector"].iloc[0]).startswith(_OWN):
        said = (
            "**Licence**: AGPL-3.0, which Ultralytics asks for its models, those trained by others too, and for what "
            "loads them."
        )
    return said + (" Trained on photos of NASA Ames: name it as their source." if weights.trained == "real" else "")

"""Table of every detector on every domain, in the layout of the paper's Table 1 and next to the paper's values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.layout import MISSING, write_blocks
from polarsim.report.training_seeds import SEED, over_seeds, seed_notes
from polarsim.schemas import detect
from polarsim.schemas.report import DETECTION
from polarsim.wording import counted

MEASURES = ("map50", "map50_95", "iou_mean")
INTERVALS = tuple(f"{name}_{bound}" for name in MEASURES for bound in ("low", "high"))
KINDS = (ROCK, "shadow", "all")
CAPTION = "Detection: mAP@0.5 / mAP@[0.5:0.95] / IOU_mean, higher is better (T: trained on, E: evaluated on)."
INTERVAL_CAPTION = "95 % intervals of the same metrics, bootstrap over {}s."


def tabulate_detection(*, detection: Path, stem: Path, origin: dict[str, str], others: Path | None = None) -> None:
    """Write tables/detection.{csv,md,tex,parquet} from detect/detection.parquet.

    `others` is the same table for detectors of further models; the rows are appended.
    """
    scores = pd.concat(
        [read_parquet(path, detect.DETECTION.columns) for path in (detection, others) if path], ignore_index=True
    )
    table = tidy_detection(scores, origin["source"])
    notes = [*paper.analog_notes(table, ("trained", "evaluated")), *detector_notes(table)]
    notes += seed_notes(table)
    if table["paper_map50"].notna().any():
        notes.append("Paper: YOLOv5 from pre-trained weights, 200 epochs, 1,730 test photos, rocks only.")
    blocks = {CAPTION: format_detection(table)}
    if not seed_notes(table):
        unit = "/".join(sorted(set(table["unit"].astype(str)))) or "view"
        blocks[INTERVAL_CAPTION.format(unit)] = format_intervals(table)
    write_blocks(stem, table, blocks, notes, origin)


def tidy_detection(detection: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return a row per kind, training domain and evaluated domain in the paper's order.

    Columns `paper_*` contain the paper's values, which exist for rocks in NASA's photos and the twins only.
    """
    table = paper.with_display_names(
        detection[[name for name in DETECTION.columns if not name.startswith("paper_")]],
        ("trained", "evaluated"),
        source,
    )
    cells = list(zip(table["kind"], table["trained"], table["evaluated"], strict=True))
    published = [
        paper.DETECTION.get((trained, evaluated)) if kind == ROCK and paper.is_comparable(source) else None
        for kind, trained, evaluated in cells
    ]
    for number, name in enumerate(MEASURES):
        values = [metrics[number] if metrics else float("nan") for metrics in published]
        table[f"paper_{name}"] = pd.Series(values, dtype="float64")
    domains = (key for name in ("trained", "evaluated") for key in (table[name].map(paper.domain_rank), table[name]))
    return paper.sorted_rows(table, table["kind"].map(KINDS.index), table["split"].astype(str), *domains)


def format_detection(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per detector and a column per evaluated domain, followed by the paper's columns."""
    return _format(table, _cell)


def format_intervals(table: pd.DataFrame) -> pd.DataFrame:
    """Return the intervals in the layout of `format_detection`; the paper has no intervals."""
    shown = _format(table, _interval_cell)
    return shown[[name for name in shown.columns if not name.startswith("paper")]]


def _format(table: pd.DataFrame, cell: Callable[[pd.DataFrame, str], str]) -> pd.DataFrame:
    evaluated = paper.sorted_domains(set(table["evaluated"]))
    several = len(table[["split", "detector", "epochs", "imgsz"]].drop_duplicates()) > 1
    comparable = table["paper_map50"].notna().any()
    published = [domain for domain in evaluated if comparable and domain in paper.DOMAIN_ORDER]
    rows = []
    names = ["kind", "split", "detector", "epochs", "imgsz", "trained"]
    for group, part in table.groupby(names, sort=False):
        kind, split, detector, epochs, imgsz, trained = (str(value) for value in group)
        row: dict[str, str] = {"labels": kind, "T": paper.domain_title(trained)}
        if several:
            row["detector"] = f"{detector}, {counted(int(epochs), 'epoch')} at {imgsz} px, split by {split}"
        for prefix, text, domains in (("", "E: {}", evaluated), ("paper_", "paper, E: {}", published)):
            for domain in domains:
                row[text.format(paper.domain_title(domain))] = cell(part[part["evaluated"] == domain], prefix)
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["labels", "T"])


def _cell(part: pd.DataFrame, prefix: str) -> str:
    metrics = part[[prefix + name for name in MEASURES]].dropna()
    if not len(metrics):
        return MISSING
    return " / ".join(over_seeds(metrics[name] if not prefix else metrics[name][:1]) for name in metrics.columns)


def _interval_cell(part: pd.DataFrame, prefix: str) -> str:
    if prefix or not len(part) or part[list(INTERVALS)].iloc[0].isna().all():
        return MISSING
    row = part.iloc[0]
    return " / ".join(f"[{row[f'{name}_low']:.3f}, {row[f'{name}_high']:.3f}]" for name in MEASURES)


def detector_notes(detection: pd.DataFrame) -> list[str]:
    """Return notes on detector, training, split, seeds and number of test images, from detect/detection.parquet."""
    seeds = ", ".join(str(seed) for seed in sorted(set(detection[SEED])))
    notes = []
    for (detector, start, _, imgsz, split), part in detection.groupby(
        ["detector", "start", "epochs", "imgsz", "split"], sort=False
    ):
        leak = "training and test share views" if part["shares_views"].any() else "training and test share no view"
        low, high = part["images"].min(), part["images"].max()
        images = f"{low}" if low == high else f"{low} to {high}"
        epochs = counted(int(part["epochs"].iloc[0]), "epoch")
        training = f"started from {start}, {epochs}, seed {seeds},"
        notes.append(f"Detector {detector}, {training} at {imgsz} px; split by {split}: {leak}; {images} test images.")
        corrupt = int(part["left_out"].max())
        if corrupt:
            notes.append(
                f"Split by {split}: up to {corrupt} corrupt images excluded from training and test of a detector."
            )
    return notes


def notes_below(
    table: pd.DataFrame,
    notes: Sequence[str],
    detection: Path | None,
    domains: Sequence[str] = ("trained", "evaluated"),
) -> list[str]:
    """Return all notes below a table of detectors: `notes` and the notes common to all such tables.

    Without `detection` (detect/detection.parquet) there are no notes on the detectors. If one of the columns `domains`
    names the analog, the first note says so.
    """
    detectors = [] if detection is None else detector_notes(read_parquet(detection, detect.DETECTION.columns))
    return [*paper.analog_notes(table, domains), *notes, *seed_notes(table), *detectors]

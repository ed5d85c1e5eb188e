"""The next run with the corrections of the page: overlay of the configuration, and the labels that it changed."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from polarsim.errors import LabelError
from polarsim.explore.tables import EDGES
from polarsim.formats.files import write_text, writing_folder
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.labels.label import Label
from polarsim.labels.seeds import read_all_corrections
from polarsim.labels.undo import COLUMNS, LabelsByPhoto, changes
from polarsim.photo import PhotoKey, Terrain, sorted_terrains, terrain_text
from polarsim.run_files.run import CONFIG, Run
from polarsim.wording import run_command

OVERLAY = "corrections.yaml"  # in the folder of the run
FORMER = "labels/before_corrections"  # label tables of the run before the corrections of the overlay
_HEADER = "# Corrections made in polarsim explore. Written by the page.\n"


def write_overlay(run: Run, corrections: Path) -> dict[str, str]:
    """Write the overlay that applies a folder of corrections; return its path and the command of the next run.

    The label tables of the corrected terrains are copied to `FORMER`, so that `changed_labels` can compare them with
    the labels of the next run. The copies are kept if no correction has changed since the last overlay.
    """
    corrected = read_all_corrections(corrections, run.site) if corrections.is_dir() else {}
    terrains = sorted_terrains(key.terrain for key in corrected)
    if not terrains:
        raise LabelError("no corrected photo", path=corrections)
    configured = run.configured("labels").get("corrections")
    root = run.folder.absolute().parents[1]
    if configured and (root / configured).resolve() != corrections.resolve():
        raise LabelError(
            f"this run reads the corrections of {configured}: move these files to {corrections}, and remove "
            "labels.corrections from the configuration",
            path=run.folder / CONFIG,
        )
    overlay = run.folder / OVERLAY
    if not overlay.exists() or _last_change(corrections) > overlay.stat().st_mtime_ns:
        with writing_folder(run.folder / FORMER) as folder:
            for terrain in terrains:
                present = _table(run, "labels/tables", terrain)
                if present.exists():
                    shutil.copy(present, folder)
        write_text(overlay, _HEADER + yaml.safe_dump({"labels": {"corrections": str(corrections)}}))
    files = [str(path) for path in (run.folder / CONFIG, overlay) if path.exists()]
    return {"overlay": str(overlay), "command": run_command(files, ["labels"])}


def changed_labels(run: Run, terrain: Terrain) -> pd.DataFrame:
    """Return the labels of a terrain that differ from those before the overlay, sorted by photo; empty without these.

    Columns: those of `polarsim undo`, and the former box (NaN for new labels).
    """
    former = _table(run, FORMER, terrain)
    rows = []
    if former.exists():
        before = _labels(read_parquet(former, LABEL_COLUMNS))
        for *change, box in changes(before, _labels(run.labels(terrain))):
            rows.append((str(change[0]), *change[1:], *(np.full(4, np.nan) if box is None else box)))
    types: dict[str, Any] = {"rock": np.int64, "moved_px": float, **dict.fromkeys(EDGES, float)}
    return pd.DataFrame(rows, columns=[*COLUMNS, *EDGES]).astype(dict.fromkeys(["key", "kind", "change"], str) | types)


def _table(run: Run, folder: str, terrain: Terrain) -> Path:
    return run.folder / folder / f"Terrain{terrain_text(terrain)}.parquet"


def _last_change(folder: Path) -> int:
    """Return the latest modification time of a folder and its files, ns. The removal of a file changes its folder."""
    return max(path.stat().st_mtime_ns for path in (folder, *folder.rglob("*")))


def _labels(table: pd.DataFrame) -> LabelsByPhoto:
    """Return the labels of a table by photo."""
    labels: dict[PhotoKey, list[Label]] = {}
    for name, rows in table.groupby("key"):
        boxes = rows[EDGES].to_numpy(float)
        columns = zip(rows["kind"], rows["rock"], rows["source"], rows["confidence"], boxes, strict=True)
        labels[PhotoKey.parse(str(name))] = [Label(*row) for row in columns]
    return labels

"""FiftyOne data set of a run: metadata.json, samples.json and data/, written without the package FiftyOne."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import ConfigError
from polarsim.explore.pictures import jpeg
from polarsim.explore.tables import EDGES, picture_table, shown_predictions
from polarsim.formats.files import check_new_folder, write_bytes, write_json, writing_folder
from polarsim.photo import HEIGHT, WIDTH
from polarsim.progress import track
from polarsim.run_files.run import PHOTO, Run

FORM = "fiftyone.types.LegacyFiftyOneDataset"  # format supported by FiftyOne since version 0.8
PARTS = ("terrain", "position", "light", "azimuth", "camera", "exposure_ms")


def write_fiftyone(
    run: Run, folder: Path, *, pattern: str = "*", domains: Sequence[str] = (), width: int = WIDTH
) -> int:
    """Write photos and twins with labels and predictions to a new folder; return the number of samples.

    A sample has the photo key, the fields of the key, domain, score and defect, labels in `ground_truth`, and a field
    of predictions per detector tested on the domain. Boxes are x, y, width and height relative to the image size.

    Raises
    ------
    ConfigError
        The folder is not empty, or no image is selected.
    """
    check_new_folder(folder)
    if unknown := [domain for domain in domains if domain not in run.domains]:
        raise ConfigError(
            f"no images of domain {', '.join(unknown)}; domains of this run: {', '.join(run.domains)}", run.folder
        )
    table = picture_table(run)
    fits = table["key"].map(lambda key: fnmatchcase(key, pattern))
    rows = table[fits & (table["domain"].isin(domains) if domains else True)].to_dict("records")
    if not rows:
        raise ConfigError(f"no image with a key like {pattern} in {', '.join(domains) or 'any domain'}", run.folder)
    labels = {of_twins: _by_key(run.all_labels(of_twins=of_twins)) for of_twins in (False, True)}
    predictions = {name: _by_key(shown_predictions(run, name)) for name in run.predictions}
    pictures = {(domain, str(key)): path for (domain, key), path in run.pictures.items()}
    samples = []
    with writing_folder(folder) as temporary:
        for row in track(rows, "samples"):
            key, domain = str(row["key"]), str(row["domain"])
            name = f"data/{domain}/{key}.jpg"
            write_bytes(temporary / name, jpeg(pictures[domain, key], width))
            sample = _sample(row, name)
            sample["ground_truth"] = _detections(labels[domain != PHOTO].get(key))
            for name, by_key in predictions.items():
                if key in by_key and run.domain_of(name.rpartition("_on_")[2]) == domain:
                    sample[_field(name)] = _detections(by_key[key])
            samples.append(sample)
        write_json(temporary / "samples.json", {"samples": samples})
        about = {"source": "polarsim", "run": run.name, "picture_width_px": width}
        write_json(temporary / "metadata.json", {"media_type": "image", "info": about})
    return len(samples)


def _by_key(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    return {str(key): part for key, part in table.groupby("key")}


def _sample(row: dict[Any, Any], name: str) -> dict[str, Any]:
    parts = {name: row[name] for name in PARTS} | {"key": row["key"], "domain": row["domain"]}
    numbers = {name: None if np.isnan(row[name]) else round(float(row[name]), 5) for name in ("score", "confidence")}
    tags = [str(row["defect"])] if row["defect"] else []
    return {"filepath": name, "tags": tags, "_media_type": "image", "metadata": None, **parts, **numbers}


def _field(name: str) -> str:
    """Return a valid field name: letters, numbers and underscores."""
    return "".join(letter if letter.isalnum() else "_" for letter in name)


def _detections(rows: pd.DataFrame | None) -> dict[str, Any]:
    detections = [] if rows is None else [_detection(row) for row in rows.to_dict("records")]
    return {"_cls": "Detections", "detections": detections}


def _detection(row: dict[Any, Any]) -> dict[str, Any]:
    x0, y0, x1, y1 = (float(row[edge]) for edge in EDGES)
    box = [x0 / WIDTH, y0 / HEIGHT, (x1 - x0) / WIDTH, (y1 - y0) / HEIGHT]
    more: dict[str, Any] = {name: bool(row[name]) for name in ("right", "false_positive") if name in row}
    more |= {"source": str(row["source"])} if "source" in row else {}
    return {
        "_cls": "Detection",
        "tags": [],
        "attributes": {},
        "label": str(row["kind"]),
        "bounding_box": [round(value, 7) for value in box],
        "confidence": round(float(row["confidence"]), 5),
        "rock": int(row["rock"]),
        **more,
    }

"""A page that reads as the results section of a paper does, from a run's tables and figures.

Every sentence follows from the tables: which figure is larger, and whether their intervals let anyone say so. The
paper's own figures stand beside ours where the source is NASA's, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.errors import about
from polarsim.formats.files import read_json, write_text
from polarsim.formats.tables import read_parquet
from polarsim.tables import (
    breakdown_table,
    detection_table,
    false_alarms_table,
    ipd_rocks_table,
    ipd_table,
    paper,
    stereo_table,
)  # fmt: skip
from polarsim.tables.layout import origin_note
from polarsim.tables.section.detection import detection_part
from polarsim.tables.section.gap import false_alarms_part, ipd_part, rocks_part
from polarsim.tables.section.ledger import ledger_part
from polarsim.tables.section.methods import Pictures, Rules, methods
from polarsim.tables.section.pages import Block, Figure, Heading, Paragraph, as_html, as_markdown
from polarsim.tables.section.parts import parts_part, stereo_part

TRAINED = ("split", "seed")
FIGURES = {  # key of a figure -> its caption; the judge of `rocks-` and `seen-` is put behind
    "comparison": "Photo, twins and their differences of one position, with labels drawn in.",
    "seen": "Photo and twins with labels (yellow, rock ids) and what a judge sees (blue), as in the paper's figures 4 "
    "and 5. Trained on {}.",
    "curves": "Precision over recall of every judge on every domain.",
    "matrices": "Rock detection of every judge (rows) on every domain (columns).",
    "ipd-bars": "IPD of rocks with 95 % intervals.",
    "ipd-histogram": "How far apart the mean IoU of single rocks is in two domains.",
    "rocks": "Rocks that the judge trained on {} finds most differently in two domains.",
    "ledger": "What each ingredient of the twins changes.",
    "opposition": "Photo and twins where the lamp stands behind the camera, and far from it.",
}


@dataclass(frozen=True)
class Found:
    """The tables of a run that the section is made of, `tables/*.parquet`; None where the run has none."""

    detection: pd.DataFrame
    breakdown: pd.DataFrame
    false_alarms: pd.DataFrame
    ipd: pd.DataFrame
    rocks: pd.DataFrame
    stereo: pd.DataFrame | None = None
    stereo_ipd: pd.DataFrame | None = None
    ledger: str | None = None  # tables/gap.md


def write_results_section(
    *,
    tables: Path,
    stereo_ipd: Path | None,
    datasets: Mapping[tuple[str, str], Path],
    pictures: Mapping[str, Path],
    figures: Mapping[str, Path],
    phases: Path | None,
    ledger: Path | None,
    page: Path,
    rules: Mapping[str, Any],
    origin: Mapping[str, str],
) -> None:
    """Write `page` (HTML, nothing beside it is needed) and the same as Markdown beside it.

    Parameters
    ----------
    tables
        Folder with detection, detection_breakdown, false_alarms, ipd, ipd_rocks and, with `stereo_ipd`, stereo.
    stereo_ipd
        The detect stage's table of stereo's IPD; None where no stereo was matched.
    datasets
        Data set of each split and domain.
    pictures
        Converted pictures of each domain.
    figures
        PNG by key of `FIGURES`, those of a judge as `seen-<judge>`.
    phases
        What the opposition figure shows, `figures/opposition.json`; None without it.
    ledger
        The gap ledger's table in Markdown; None where the run has none.
    rules
        The detect stage's options by name.

    Raises
    ------
    PolarsimError
        A table or data set is broken.
    """
    known = Rules(**{name: rules[name] for name in Rules.__dataclass_fields__})
    counts = Pictures(
        {place: _counts(path / "dataset.json") for place, path in datasets.items()},
        {domain: _counts(path / "domain.json") for domain, path in pictures.items()},
    )
    shown, said = _phases(phases)
    if not shown:
        figures = {key: path for key, path in figures.items() if key != "opposition"}
    blocks = section(_found(tables, stereo_ipd, ledger), counts, known, figures, said, origin)
    title = f"Results of run {origin['run']}"
    write_text(page, as_html(title, blocks))
    folder = Path("..") / "figures"
    write_text(page.with_suffix(".md"), as_markdown(title, blocks, folder.as_posix()))


def section(
    found: Found,
    pictures: Pictures,
    rules: Rules,
    figures: Mapping[str, Path],
    phase_words: str,
    origin: Mapping[str, str],
) -> list[Block]:
    """All blocks in their order."""
    source = origin["source"]
    photos = paper.ANALOG if source == paper.ANALOG else paper.REAL
    judges = paper.in_order(set(found.detection["trained"]))
    if not len(found.detection):
        return [Paragraph("No judge was trained in this run."), Paragraph(origin_note(dict(origin)), note=True)]
    shown = _Shown(figures, judges)
    return [
        *methods(found.detection, pictures, rules, origin),
        *shown.of("comparison"),
        *detection_part(found.detection, photos, source),
        *shown.of("matrices", "curves", "seen"),
        *ipd_part(found.ipd, photos, source),
        *shown.of("ipd-bars", "ipd-histogram"),
        *rocks_part(found.rocks, photos, {name for name in judges if f"rocks-{name}" in figures}),
        *shown.of("rocks"),
        *parts_part(found.breakdown, photos),
        *false_alarms_part(found.false_alarms),
        *stereo_part(found.stereo, found.stereo_ipd, source),
        Heading("Opposition effect"),
        Paragraph(phase_words + (" ([[opposition]])." if "opposition" in figures else ".")),
        *shown.of("opposition"),
        *ledger_part(found.ledger),
        *shown.of("ledger"),
        Paragraph(
            origin_note(dict(origin))
            + " Several splits or seeds: figures that cannot show all of them show the first.",
            note=True,
        ),
    ]


class _Shown:
    """Figures that the run has, by the keys of `FIGURES`."""

    def __init__(self, paths: Mapping[str, Path], judges: list[str]) -> None:
        self._paths, self._judges = paths, judges

    def of(self, *keys: str) -> list[Block]:
        blocks: list[Block] = []
        for key in keys:
            names = {key: ""} | {f"{key}-{judge}": paper.title(judge) for judge in self._judges}
            blocks += [Figure(name, FIGURES[key].format(title), self._paths[name])
                       for name, title in names.items() if name in self._paths]  # fmt: skip
        return blocks


def _found(tables: Path, stereo_ipd: Path | None, ledger: Path | None) -> Found:
    def read(name: str, columns: tuple[str, ...]) -> pd.DataFrame:
        return read_parquet(tables / f"{name}.parquet", columns)

    return Found(
        read("detection", (*TRAINED[:1], *detection_table.COLUMNS)),
        read("detection_breakdown", (*TRAINED, *breakdown_table.COLUMNS)),
        read("false_alarms", (*TRAINED, *false_alarms_table.COLUMNS)),
        read("ipd", (*TRAINED, *ipd_table.COLUMNS)),
        read("ipd_rocks", (*TRAINED, *ipd_rocks_table.COLUMNS)),
        read("stereo", stereo_table.COLUMNS) if stereo_ipd else None,
        read_parquet(stereo_ipd, stereo_table.IPD_COLUMNS) if stereo_ipd else None,
        ledger.read_text(encoding="utf-8") if ledger else None,
    )


def _counts(path: Path) -> dict[str, int]:
    """The counts of pictures in `dataset.json` or `domain.json`."""
    content = read_json(path)
    with about(path):
        return {str(name): int(number) for name, number in content["pictures"].items()}


def _phases(path: Path | None) -> tuple[bool, str]:
    """Whether there is a figure of the opposition effect, and what it shows or why there is none."""
    if path is None:
        return False, "This run draws no figure of the opposition effect"
    content = read_json(path)
    with about(path):
        return bool(content["shown"]), str(content["words"])

"""Table of the mean IoU of every rock in two domains; Markdown and LaTeX show the rocks with the largest difference."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import notes_below
from polarsim.report.layout import with_origin, write_table
from polarsim.report.training_seeds import SEED
from polarsim.schemas.detect import IPD_ROCKS

DOMAINS = ("trained", "first", "second")
CAPTION = "Rocks with the largest difference of mean IoU between two domains (T: trained on)."
SHOWN = 5  # rocks of each detector and pair of domains


def tabulate_ipd_rocks(*, rocks: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd_rocks.{csv,md,tex,parquet} from detect/rocks.parquet."""
    table = tidy_ipd_rocks(read_parquet(rocks, IPD_ROCKS.columns), origin["source"])
    extract = [f"This table lists {SHOWN} rocks per pair; the CSV and Parquet files contain all rocks and shadows."]
    notes = notes_below(table.drop(columns=SEED, errors="ignore"), extract, detection, origin, DOMAINS)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_ipd_rocks(table), notes=notes)


def tidy_ipd_rocks(rocks: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the rows with the domain names of the tables, each pair of domains in the paper's order."""
    table = paper.with_display_names(rocks, DOMAINS, source)
    swapped = pd.Series(
        [paper.ordered_pair(*pair) != pair for pair in zip(table["first"], table["second"], strict=True)], dtype=bool
    )
    for a, b in (("first", "second"), ("iou_first", "iou_second")):
        table[a], table[b] = table[a].where(~swapped, table[b]), table[b].where(~swapped, table[a])
    table["difference"] = table["iou_first"] - table["iou_second"]
    ranks = (table[name].map(paper.domain_rank) for name in DOMAINS)
    return paper.sorted_rows(table, *ranks, table["kind"], table["terrain"], table["rock"])


def largest(table: pd.DataFrame, count: int) -> pd.DataFrame:
    """Return the `count` rocks with the largest absolute difference."""
    size = table["difference"].abs().round(9)
    order = pd.DataFrame({"size": -size, "terrain": table["terrain"], "rock": table["rock"]})
    return table.loc[order.sort_values(["size", "terrain", "rock"], kind="stable").index[:count]]


def format_ipd_rocks(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per rock for every detector and pair of domains, largest difference first."""
    columns = ["T", "domains", "terrain", "rock", "photos", "mean IoU, first", "mean IoU, second", "difference"]
    rows = []
    varied = [name for name in ("split", SEED) if name in table.columns and len(set(table[name])) > 1]
    for group, part in table[table["kind"] == ROCK].groupby([*varied, *DOMAINS], sort=False):
        *setting, trained, first, second = (str(value) for value in group)
        pair = f"{paper.domain_title(first)} - {paper.domain_title(second)}"
        for row in largest(part, SHOWN).to_dict("records"):
            cells = (row["terrain"], row["rock"], row["photos"], row["iou_first"], row["iou_second"], row["difference"])
            values = (paper.domain_title(trained), pair, *cells)
            rows.append(dict(zip(varied, setting, strict=True)) | dict(zip(columns, values, strict=True)))
    return pd.DataFrame(rows, columns=None if rows else columns)

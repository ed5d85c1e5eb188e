"""The table of rocks: how well each one is found in two domains, and the rocks that differ most."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import notes_below
from polarsim.report.layout import with_origin, write_table
from polarsim.report.seeds import SEED
from polarsim.schemas.detect import IPD_ROCKS

DOMAINS = ("trained", "first", "second")
CAPTION = "Rocks whose mean IoU differs most between two domains (T: trained on)."
SHOWN = 5  # rocks of each detector and pair of domains


def tabulate_ipd_rocks(*, rocks: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd_rocks.{csv,md,tex,parquet} from detect/rocks.parquet."""
    table = tidy_ipd_rocks(read_parquet(rocks, IPD_ROCKS.columns), origin["source"])
    own = [f"CSV and Parquet have every rock and shadow; here are {SHOWN} rocks of each pair."]
    notes = notes_below(table.drop(columns=SEED, errors="ignore"), own, detection, origin, DOMAINS)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_ipd_rocks(table), notes=notes)


def tidy_ipd_rocks(rocks: pd.DataFrame, source: str) -> pd.DataFrame:
    """Domains by their names in our tables, each pair in the paper's order of them."""
    table = paper.with_own_names(rocks, DOMAINS, source)
    swapped = pd.Series(
        [paper.ordered_pair(*pair) != pair for pair in zip(table["first"], table["second"], strict=True)], dtype=bool
    )
    for one, other in (("first", "second"), ("iou_first", "iou_second")):
        table[one], table[other] = table[one].where(~swapped, table[other]), table[other].where(~swapped, table[one])
    table["difference"] = table["iou_first"] - table["iou_second"]
    ranks = (table[name].map(paper.rank) for name in DOMAINS)
    return paper.sorted_rows(table, *ranks, table["kind"], table["terrain"], table["rock"])


def largest(table: pd.DataFrame, count: int) -> pd.DataFrame:
    """The rocks of the largest difference, whichever its sign."""
    size = table["difference"].abs().round(9)
    order = pd.DataFrame({"size": -size, "terrain": table["terrain"], "rock": table["rock"]})
    return table.loc[order.sort_values(["size", "terrain", "rock"], kind="stable").index[:count]]


def format_ipd_rocks(table: pd.DataFrame) -> pd.DataFrame:
    """A row a rock, the most different first, of every detector and pair."""
    columns = ["T", "domains", "terrain", "rock", "photos", "mean IoU, first", "mean IoU, second", "difference"]
    rows = []
    drawn = [name for name in ("split", SEED) if name in table.columns and len(set(table[name])) > 1]
    for group, part in table[table["kind"] == ROCK].groupby([*drawn, *DOMAINS], sort=False):
        *which, trained, first, second = (str(value) for value in group)
        pair = f"{paper.title(first)} - {paper.title(second)}"
        for row in largest(part, SHOWN).to_dict("records"):
            figures = (row["terrain"], row["rock"], row["photos"], row["iou_first"], row["iou_second"])
            values = (paper.title(trained), pair, *figures, row["difference"])
            rows.append(dict(zip(drawn, which, strict=True)) | dict(zip(columns, values, strict=True)))
    return pd.DataFrame(rows, columns=None if rows else columns)

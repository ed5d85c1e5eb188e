"""The table of rocks: how well each one is found in two domains, and the rocks that differ most."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import notes_of_detectors
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.seeds import SEED

COLUMNS = (
    "trained", "first", "second", "terrain", "rock", "kind", "photos", "iou_first", "iou_second", "difference",
)  # fmt: skip
CAPTION = "Rocks whose mean IoU differs most between two domains (T: trained on)."
SHOWN = 5  # rocks of each detector and pair of domains


def tabulate_ipd_rocks(*, rocks: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd_rocks.{csv,md,tex,parquet} from detect/rocks.parquet, detectors by `detection`."""
    table = tidy_ipd_rocks(read_parquet(rocks, COLUMNS), origin["source"])
    notes = [
        f"CSV and Parquet have every rock and shadow; here are {SHOWN} rocks of each pair.",
        *notes_of_detectors(detection),
        origin_note(origin),
    ]
    if paper.ANALOG in {*table["trained"], *table["first"], *table["second"]}:
        notes.insert(0, paper.ANALOG_PICTURES_NOTE)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_ipd_rocks(table), notes=notes)


def tidy_ipd_rocks(rocks: pd.DataFrame, source: str) -> pd.DataFrame:
    """Domains by their names in our tables, each pair in the paper's order of them."""
    table = paper.with_own_names(rocks, ("trained", "first", "second"), source)
    turned = pd.Series(
        [paper.ordered_pair(*pair) != pair for pair in zip(table["first"], table["second"], strict=True)], dtype=bool
    )
    for one, other in (("first", "second"), ("iou_first", "iou_second")):
        table[one], table[other] = table[one].where(~turned, table[other]), table[other].where(~turned, table[one])
    table["difference"] = table["iou_first"] - table["iou_second"]
    ranks = {"trained": paper.rank, "first": paper.rank, "second": paper.rank}
    order = pd.DataFrame({name: table[name].map(rank) for name, rank in ranks.items()})
    order = order.assign(kind=table["kind"], terrain=table["terrain"], rock=table["rock"])
    return table.loc[order.sort_values(list(order.columns), kind="stable").index].reset_index(drop=True)


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
    names = ["trained", "first", "second"]
    for group, part in table[table["kind"] == ROCK].groupby([*drawn, *names], sort=False):
        *which, trained, first, second = (str(value) for value in group)
        pair = f"{paper.title(first)} - {paper.title(second)}"
        for row in largest(part, SHOWN).to_dict("records"):
            figures = (row["terrain"], row["rock"], row["photos"], row["iou_first"], row["iou_second"])
            values = (paper.title(trained), pair, *figures, row["difference"])
            rows.append(dict(zip(drawn, which, strict=True)) | dict(zip(columns, values, strict=True)))
    return pd.DataFrame(rows, columns=None if rows else columns)

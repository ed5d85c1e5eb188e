"""Tables of instance performance differences: of domains, next to the paper's values (Table 2), and of every rock."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import KINDS, notes_below
from polarsim.report.layout import MISSING, write_table
from polarsim.report.training_seeds import SEED, metric_cell
from polarsim.schemas import detect
from polarsim.schemas.report import IPD

CAPTION = "Instance performance difference, lower is better (T: trained on). Each cell: ipd [95 %] / ipd_abs [95 %]."
FORMULA_NOTE = (
    "ipd: absolute value of the mean difference of the rocks' IoU, as in the paper's table. ipd_abs: mean of the "
    "absolute differences; gains and losses do not cancel."
)
_DOMAINS = ("trained", "first", "second")
ROCKS_CAPTION = "Rocks with the largest difference of mean IoU between two domains (T: trained on)."
SHOWN = 5  # rocks of each detector and pair of domains


def tabulate_ipd(*, ipd: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd.{csv,md,tex,parquet} from detect/ipd.parquet."""
    table = tidy_ipd(read_parquet(ipd, detect.IPD.columns), origin["source"])
    notes = notes_below(table, [FORMULA_NOTE, *_rule_notes(table)], detection, _DOMAINS)
    write_table(stem, table, CAPTION, layout=format_ipd(table), notes=notes, origin=origin)


def tidy_ipd(ipd: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return a row per kind, detector and pair of domains in the paper's order; `paper_ipd` is the paper's value."""
    rows = []
    for entry in ipd[list(detect.IPD.columns)].to_dict("records"):
        trained, *pair = (paper.display_name(str(entry[name]), source) for name in _DOMAINS)
        first, second = paper.ordered_pair(*pair)
        comparable = entry["kind"] == ROCK and paper.is_comparable(source)
        published = paper.IPD.get((trained, (first, second))) if comparable else None
        rows.append({**entry, "trained": trained, "first": first, "second": second, "paper_ipd": published})
    rows.sort(key=_order)
    table = pd.DataFrame(rows, columns=list(IPD.columns))
    return table.astype({"paper_ipd": "float64", "trained": "str", "first": "str", "second": "str"})


def format_ipd(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per detector and a column per pair of domains, followed by the paper's columns, if any."""
    pairs = sorted(set(zip(table["first"], table["second"], strict=True)), key=_pair_order)
    published = [pair for pair in pairs if pair in paper.PAIRS and table["paper_ipd"].notna().any()]
    rows = []
    splits = set(table["split"])
    for (split, kind, trained), part in table.groupby(["split", "kind", "trained"], sort=False):
        row: dict[str, str] = {"labels": str(kind), "T": paper.domain_title(str(trained))}
        if len(splits) > 1:
            row["split by"] = str(split)
        for first, second in pairs:
            row[paper.pair_title(first, second)] = _cell(part[(part["first"] == first) & (part["second"] == second)])
        for first, second in published:
            values = part[(part["first"] == first) & (part["second"] == second)]["paper_ipd"].dropna()
            row[f"paper, {paper.pair_title(first, second)}"] = f"{values.iloc[0]:.4f}" if len(values) else MISSING
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["labels", "T"])


def _cell(scores: pd.DataFrame) -> str:
    if not len(scores):
        return MISSING
    parts = []
    for name in ("ipd", "ipd_abs"):
        if scores[name].isna().all():  # no rock is labelled in both domains
            return MISSING
        value, _, interval = metric_cell(scores, name).partition(" [")
        if len(scores) == 1:
            value = f"{scores[name].iloc[0]:.4f}"  # as many digits as in the paper
        parts.append(f"{value} [{interval}" if interval else value)
    return " / ".join(parts)


def _rule_notes(table: pd.DataFrame) -> list[str]:
    """Return notes on the options of the IPD."""
    text = {"zero": "IoU 0", "left_out": "excluded"}
    return [
        f"Minimum confidence {confidence:g}; rocks without an overlapping prediction: {text[undetected]}; "
        f"rocks labelled in a single domain: {text[unpaired]}; intervals: 95 %, bootstrap over {unit}s."
        for unit, undetected, unpaired, confidence in table[["unit", "undetected", "unpaired", "confidence"]]
        .drop_duplicates()
        .itertuples(index=False)
    ]


def _pair_order(pair: tuple[str, str]) -> tuple[object, ...]:
    of_paper = paper.counterpart(pair[0]), paper.counterpart(pair[1])
    return (paper.PAIRS.index(of_paper) if of_paper in paper.PAIRS else len(paper.PAIRS)), pair


def _order(row: Mapping[Hashable, object]) -> tuple[object, ...]:
    trained, pair = str(row["trained"]), (str(row["first"]), str(row["second"]))
    return KINDS.index(str(row["kind"])), str(row["split"]), paper.domain_rank(trained), trained, _pair_order(pair)


def tabulate_ipd_rocks(*, rocks: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd_rocks.{csv,md,tex,parquet} from detect/rocks.parquet."""
    table = tidy_ipd_rocks(read_parquet(rocks, detect.IPD_ROCKS.columns), origin["source"])
    extract = [f"This table lists {SHOWN} rocks per pair; the CSV and Parquet files contain all rocks and shadows."]
    notes = notes_below(table.drop(columns=SEED, errors="ignore"), extract, detection, _DOMAINS)
    write_table(stem, table, ROCKS_CAPTION, layout=format_ipd_rocks(table), notes=notes, origin=origin)


def tidy_ipd_rocks(rocks: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the rows with the domain names of the tables, each pair of domains in the paper's order."""
    table = paper.with_display_names(rocks, _DOMAINS, source)
    swapped = pd.Series(
        [paper.ordered_pair(*pair) != pair for pair in zip(table["first"], table["second"], strict=True)], dtype=bool
    )
    for a, b in (("first", "second"), ("iou_first", "iou_second")):
        table[a], table[b] = table[a].where(~swapped, table[b]), table[b].where(~swapped, table[a])
    table["difference"] = table["iou_first"] - table["iou_second"]
    ranks = (table[name].map(paper.domain_rank) for name in _DOMAINS)
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
    for group, part in table[table["kind"] == ROCK].groupby([*varied, *_DOMAINS], sort=False):
        *setting, trained, first, second = (str(value) for value in group)
        pair = paper.pair_title(first, second)
        for row in largest(part, SHOWN).to_dict("records"):
            cells = (row["terrain"], row["rock"], row["photos"], row["iou_first"], row["iou_second"], row["difference"])
            values = (paper.domain_title(trained), pair, *cells)
            rows.append(dict(zip(varied, setting, strict=True)) | dict(zip(columns, values, strict=True)))
    return pd.DataFrame(rows, columns=None if rows else columns)

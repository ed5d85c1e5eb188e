"""The table of instance performance differences, in the layout of the paper's Table 2 with its figures beside."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import KINDS, notes_below
from polarsim.report.layout import MISSING, with_origin, write_table
from polarsim.report.seeds import shown
from polarsim.schemas import detect
from polarsim.schemas.report import IPD

CAPTION = "Instance performance difference, lower is better (T: trained on). Each cell: ipd [95 %] / ipd_abs [95 %]."
FORMULA_NOTE = (
    "ipd is the absolute value of the mean difference of the rocks' IoU, as the paper's table computes it; ipd_abs is "
    "the mean of the absolute differences, where gains and losses cannot cancel."
)


def tabulate_ipd(*, ipd: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd.{csv,md,tex,parquet} from detect/ipd.parquet."""
    table = tidy_ipd(read_parquet(ipd, detect.IPD.columns), origin["source"])
    own, domains = [FORMULA_NOTE, *_rule_notes(table)], ("trained", "first", "second")
    notes = notes_below(table, own, detection, origin, domains)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_ipd(table), notes=notes)


def tidy_ipd(ipd: pd.DataFrame, source: str) -> pd.DataFrame:
    """A row for every kind, detector and pair of domains in the paper's order; `paper_ipd` where it has one."""
    rows = []
    for entry in ipd[list(detect.IPD.columns)].to_dict("records"):
        trained, *pair = (paper.own_name(str(entry[name]), source) for name in ("trained", "first", "second"))
        first, second = paper.ordered_pair(*pair)
        known = entry["kind"] == ROCK and paper.is_comparable(source)
        figure = paper.IPD.get((trained, (first, second))) if known else None
        rows.append({**entry, "trained": trained, "first": first, "second": second, "paper_ipd": figure})
    rows.sort(key=_order)
    table = pd.DataFrame(rows, columns=list(IPD.columns))
    return table.astype({"paper_ipd": "float64", "trained": "str", "first": "str", "second": "str"})


def format_ipd(table: pd.DataFrame) -> pd.DataFrame:
    """The paper's Table 2 out of tidy rows: a row a detector, a column a pair, then the paper's where there are any."""
    pairs = sorted(set(zip(table["first"], table["second"], strict=True)), key=_pair_order)
    theirs = [pair for pair in pairs if pair in paper.PAIRS and table["paper_ipd"].notna().any()]
    rows = []
    splits = set(table["split"])
    for (split, kind, trained), part in table.groupby(["split", "kind", "trained"], sort=False):
        row: dict[str, str] = {"labels": str(kind), "T": paper.title(str(trained))}
        if len(splits) > 1:
            row["split by"] = str(split)
        for first, second in pairs:
            found = part[(part["first"] == first) & (part["second"] == second)]
            row[_pair_title(first, second)] = _cell(found)
        for first, second in theirs:
            found = part[(part["first"] == first) & (part["second"] == second)]
            values = found["paper_ipd"].dropna()
            row[f"paper, {_pair_title(first, second)}"] = f"{values.iloc[0]:.4f}" if len(values) else MISSING
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["labels", "T"])


def _cell(found: pd.DataFrame) -> str:
    if not len(found):
        return MISSING
    parts = []
    for name in ("ipd", "ipd_abs"):
        if found[name].isna().all():  # no rock is labelled in both domains
            return MISSING
        value, _, interval = shown(found, name).partition(" [")
        if len(found) == 1:
            value = f"{found[name].iloc[0]:.4f}"  # as many digits as the paper prints
        parts.append(f"{value} [{interval}" if interval else value)
    return " / ".join(parts)


def _rule_notes(table: pd.DataFrame) -> list[str]:
    """The rules of pairing."""
    text = {"zero": "IoU 0", "left_out": "left out"}
    return [
        f"Least confidence {confidence:g}; rocks that no prediction overlaps: {text[undetected]}; "
        f"rocks labelled in one domain only: {text[unpaired]}; intervals: 95 % bootstrap of {unit}s."
        for unit, undetected, unpaired, confidence in table[["unit", "undetected", "unpaired", "confidence"]]
        .drop_duplicates()
        .itertuples(index=False)
    ]


def _pair_title(first: str, second: str) -> str:
    return f"{paper.title(first)} - {paper.title(second)}"


def _pair_order(pair: tuple[str, str]) -> tuple[object, ...]:
    theirs = paper.counterpart(pair[0]), paper.counterpart(pair[1])
    return (paper.PAIRS.index(theirs) if theirs in paper.PAIRS else len(paper.PAIRS)), pair


def _order(row: Mapping[Hashable, object]) -> tuple[object, ...]:
    trained, pair = str(row["trained"]), (str(row["first"]), str(row["second"]))
    return KINDS.index(str(row["kind"])), str(row["split"]), paper.rank(trained), trained, _pair_order(pair)

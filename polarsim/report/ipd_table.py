"""Table of instance performance differences, in the layout of the paper's Table 2 and next to the paper's values."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import KINDS, notes_below
from polarsim.report.layout import MISSING, with_origin, write_table
from polarsim.report.training_seeds import metric_cell
from polarsim.schemas import detect
from polarsim.schemas.report import IPD

CAPTION = "Instance performance difference, lower is better (T: trained on). Each cell: ipd [95 %] / ipd_abs [95 %]."
FORMULA_NOTE = (
    "ipd: absolute value of the mean difference of the rocks' IoU, as in the paper's table. ipd_abs: mean of the "
    "absolute differences; gains and losses do not cancel."
)


def tabulate_ipd(*, ipd: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/ipd.{csv,md,tex,parquet} from detect/ipd.parquet."""
    table = tidy_ipd(read_parquet(ipd, detect.IPD.columns), origin["source"])
    definitions, domains = [FORMULA_NOTE, *_rule_notes(table)], ("trained", "first", "second")
    notes = notes_below(table, definitions, detection, origin, domains)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_ipd(table), notes=notes)


def tidy_ipd(ipd: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return a row per kind, detector and pair of domains in the paper's order; `paper_ipd` is the paper's value."""
    rows = []
    for entry in ipd[list(detect.IPD.columns)].to_dict("records"):
        trained, *pair = (paper.display_name(str(entry[name]), source) for name in ("trained", "first", "second"))
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
            row[_pair_title(first, second)] = _cell(part[(part["first"] == first) & (part["second"] == second)])
        for first, second in published:
            values = part[(part["first"] == first) & (part["second"] == second)]["paper_ipd"].dropna()
            row[f"paper, {_pair_title(first, second)}"] = f"{values.iloc[0]:.4f}" if len(values) else MISSING
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


def _pair_title(first: str, second: str) -> str:
    return f"{paper.domain_title(first)} - {paper.domain_title(second)}"


def _pair_order(pair: tuple[str, str]) -> tuple[object, ...]:
    of_paper = paper.counterpart(pair[0]), paper.counterpart(pair[1])
    return (paper.PAIRS.index(of_paper) if of_paper in paper.PAIRS else len(paper.PAIRS)), pair


def _order(row: Mapping[Hashable, object]) -> tuple[object, ...]:
    trained, pair = str(row["trained"]), (str(row["first"]), str(row["second"]))
    return KINDS.index(str(row["kind"])), str(row["split"]), paper.domain_rank(trained), trained, _pair_order(pair)

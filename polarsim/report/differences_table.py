"""The table of paired differences: what separates two detectors, two domains or two gaps, and how surely."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report import paper
from polarsim.report.detection_table import KINDS, notes_of_detectors
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.seeds import SEED, over_seeds, seed_notes, shown

DOMAINS = ("trained", "evaluated", "other_trained", "other_evaluated")
COLUMNS = (
    "split", "seed", "metric", "kind", "against", *DOMAINS, "value", "other_value", "difference", "difference_low",
    "difference_high", "units", "unit",
)  # fmt: skip
METRICS = {"map50": "mAP@0.5", "ipd": "IPD"}
CAPTION = "Paired differences: each of the first minus the second, with its own 95 % interval."
NOTE = (
    "Both sides of a difference are resampled together, so its interval tells whether they differ: it holds zero where "
    "these photos cannot tell. Intervals of the two metrics themselves may meet all the same. IPD: lower is better."
)


def tabulate_differences(*, differences: Path, detection: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/differences.{csv,md,tex,parquet} from detect/differences.parquet, notes from `detection`."""
    table = tidy_differences(read_parquet(differences, COLUMNS), origin["source"])
    units = sorted(set(table["unit"].astype(str)))
    notes = [NOTE, *(f"Resampled: {unit}s." for unit in units), *seed_notes(table), *notes_of_detectors(detection)]
    layout = format_differences(table)
    write_table(stem, with_origin(table, origin), CAPTION, layout=layout, notes=[*notes, origin_note(origin)])


def tidy_differences(differences: pd.DataFrame, source: str) -> pd.DataFrame:
    """Rows with domains by their names in our tables: rocks first, mAP before IPD, in the paper's order of domains."""
    table = paper.with_own_names(differences, [*DOMAINS, "against"], source)
    kind = table["kind"].map(KINDS.index)
    metric = table["metric"].map(list(METRICS).index)
    ranks = [table[name].map(paper.rank) for name in ("trained", "against", "evaluated", *DOMAINS[2:])]
    order = pd.concat([kind, table["split"], metric, *ranks, table[SEED]], axis=1)
    order.columns = pd.Index(range(order.shape[1]))
    places = order.sort_values(list(order.columns), kind="stable").index
    return table.loc[places].reset_index(drop=True)


def format_differences(table: pd.DataFrame) -> pd.DataFrame:
    """A row a comparison: what is compared, both values, their difference with its interval."""
    rows = []
    several = len(set(table["split"])) > 1
    for key, part in table.groupby(["kind", "split", "metric", "against", *DOMAINS], sort=False):
        kind, split, metric, against, *sides = map(str, key)
        row = {"labels": kind} | ({"split by": split} if several else {})
        row |= {"metric": METRICS[metric], "first": _side(against, *sides[:2]), "second": _side(against, *sides[2:])}
        row |= {"of the first": over_seeds(part["value"]), "of the second": over_seeds(part["other_value"])}
        rows.append(row | {"difference": shown(part, "difference")})
    return pd.DataFrame(rows)


def _side(against: str, trained: str, evaluated: str) -> str:
    """What a metric is of; an IPD lies between two domains."""
    seen = f"{paper.title(against)} and {paper.title(evaluated)}" if against else paper.title(evaluated)
    return f"{paper.title(trained)} on {seen}"

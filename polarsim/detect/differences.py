"""Differences between metrics of detectors and domains, each with the interval of the difference itself.

Two metrics whose 95 % intervals meet may still differ for sure: photos of one view are easy or hard for every detector
and in every domain. So the same resamples of views are drawn for both sides, and the interval is that of what changes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

import pandas as pd

from polarsim.detect.domain_evaluation import DomainEvaluation, change, ipd_change
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.detect import DIFFERENCES

SIDES = ("trained", "evaluated")
OTHER_SIDES = ("other_trained", "other_evaluated")
_VALUES = ("value", "other_value", "difference", "difference_low", "difference_high")
DIFFERENCE_COLUMNS = DIFFERENCES.without("split", "seed")


def paired_differences(seen: Mapping[tuple[str, str], DomainEvaluation]) -> pd.DataFrame:
    """`DIFFERENCE_COLUMNS` of all comparisons that a reader of the tables makes.

    mAP@0.5 of one detector on its own domain and on another one; mAP@0.5 on one domain of its own detector and of
    another one; IPD of one detector between a domain (`against`) and each of two others. A difference is that of the
    first (`trained`, `evaluated`) minus that of the other.

    Parameters
    ----------
    seen
        Every domain through every detector, (trained, evaluated); all of the same photos and options.
    """
    some = next(iter(seen.values()))
    units = some.draws[1].shape[1]
    rows: list[dict[str, object]] = []
    for one, other in _compared_precisions(seen):
        for kind in BOX_CLASSES:
            first, second = seen[one].precision[kind], seen[other].precision[kind]
            rows.append(_row("map50", kind, "", one, other, change("map50", second, first, units)))
    for against, one, other in _compared_ipds(seen):
        for kind in BOX_CLASSES:
            changed = ipd_change(kind, seen[against], seen[other], seen[one])
            if changed["pairs"]:
                rows.append(_row("ipd", kind, against[1], one, other, changed) | {"pairs": changed["pairs"]})
    table = pd.DataFrame(rows, columns=list(DIFFERENCE_COLUMNS))
    return table.assign(images=len(some.keys), units=units, unit=some.options.resampled)


def _compared_precisions(
    seen: Mapping[tuple[str, str], DomainEvaluation],
) -> Iterator[tuple[tuple[str, str], tuple[str, str]]]:
    """Own domain and another one of each detector, then own detector and another one of each domain."""
    own = sorted(sides for sides in seen if sides[0] == sides[1])
    for mine in own:
        yield from ((mine, other) for other in sorted(seen) if other[0] == mine[0] and other != mine)
    for mine in own:
        yield from ((mine, other) for other in sorted(seen) if other[1] == mine[1] and other != mine)


def _compared_ipds(
    seen: Mapping[tuple[str, str], DomainEvaluation],
) -> Iterator[tuple[tuple[str, str], tuple[str, str], tuple[str, str]]]:
    """A domain and each two others of every detector."""
    for trained in sorted({trained for trained, _ in seen}):
        domains = sorted(evaluated for detector, evaluated in seen if detector == trained)
        for against in domains:
            for one, other in combinations([domain for domain in domains if domain != against], 2):
                yield (trained, against), (trained, one), (trained, other)


def _row(
    metric: str, kind: str, against: str, one: tuple[str, str], other: tuple[str, str], changed: Mapping[str, object]
) -> dict[str, object]:
    """`changed` holds the other side as the twin, and the first one as what replaces it."""
    ends = ("", "_twin", "_change", "_change_low", "_change_high")
    values = [changed[f"{metric}{end}"] for end in ends]
    sides = dict(zip((*SIDES, *OTHER_SIDES), (*one, *other), strict=True))
    return {"metric": metric, "kind": kind, "against": against, **sides, **dict(zip(_VALUES, values, strict=True))}

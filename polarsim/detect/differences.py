"""Paired differences between metrics of detectors and domains, with confidence intervals.

Two metrics with overlapping 95 % intervals can still differ significantly, because the difficulty of a view is similar
for all detectors and domains. Both sides use the same bootstrap replicates, and the interval refers to the difference.
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
    """Return `DIFFERENCE_COLUMNS` of all comparisons.

    - mAP@0.5 of a detector on its training domain and on a different domain.
    - mAP@0.5 on a domain of the detector trained on that domain and of a different detector.
    - IPD of a detector between the domain `against` and each of two more domains.

    A difference is the metric of (`trained`, `evaluated`) minus the metric of (`other_trained`, `other_evaluated`).

    Parameters
    ----------
    seen
        Evaluations by (trained, evaluated), all with the same photos and options.
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
    """Yield pairs of domains of each detector, then pairs of detectors on each domain; the first has equal domains."""
    same_domain = sorted(sides for sides in seen if sides[0] == sides[1])
    for same in same_domain:
        yield from ((same, other) for other in sorted(seen) if other[0] == same[0] and other != same)
    for same in same_domain:
        yield from ((same, other) for other in sorted(seen) if other[1] == same[1] and other != same)


def _compared_ipds(
    seen: Mapping[tuple[str, str], DomainEvaluation],
) -> Iterator[tuple[tuple[str, str], tuple[str, str], tuple[str, str]]]:
    """Yield each domain with each pair of the remaining domains, for every detector."""
    for trained in sorted({trained for trained, _ in seen}):
        domains = sorted(evaluated for detector, evaluated in seen if detector == trained)
        for against in domains:
            for one, other in combinations([domain for domain in domains if domain != against], 2):
                yield (trained, against), (trained, one), (trained, other)


def _row(
    metric: str, kind: str, against: str, one: tuple[str, str], other: tuple[str, str], changed: Mapping[str, object]
) -> dict[str, object]:
    """Return a row. In `changed`, the second side of the comparison has the suffix `_twin`."""
    ends = ("", "_twin", "_change", "_change_low", "_change_high")
    values = [changed[f"{metric}{end}"] for end in ends]
    sides = dict(zip((*SIDES, *OTHER_SIDES), (*one, *other), strict=True))
    return {"metric": metric, "kind": kind, "against": against, **sides, **dict(zip(_VALUES, values, strict=True))}

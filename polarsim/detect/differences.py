"""Paired differences between metrics of detectors and domains, with confidence intervals.

Two metrics with overlapping 95 % intervals can still differ significantly, because the difficulty of a view is similar
for all detectors and domains. Both sides use the same bootstrap replicates, and the interval refers to the difference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations, product

import pandas as pd

from polarsim.detect.domain_evaluation import DomainEvaluation, ipd_change, paired_change
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.detect import DIFFERENCES

SIDE_COLUMNS = ("trained", "evaluated")
OTHER_SIDES = ("other_trained", "other_evaluated")
_VALUES = ("value", "other_value", "difference", "difference_low", "difference_high")
DIFFERENCE_COLUMNS = DIFFERENCES.without("split", "seed")


def paired_differences(evaluations: Mapping[tuple[str, str], DomainEvaluation]) -> pd.DataFrame:
    """Return `DIFFERENCE_COLUMNS` of all comparisons.

    - mAP@0.5 of a detector on its training domain and on a different domain.
    - mAP@0.5 on a domain of the detector trained on that domain and of a different detector.
    - IPD of a detector between the domain `against` and each of two more domains.

    A difference is the metric of (`trained`, `evaluated`) minus the metric of (`other_trained`, `other_evaluated`).

    `evaluations` are by (trained, evaluated), all with the same photos and options.
    """
    any_evaluation = next(iter(evaluations.values()))
    units = any_evaluation.draws[1].shape[1]
    rows: list[dict[str, object]] = []
    for first_side, second_side in _compared_precisions(evaluations):
        for kind in BOX_CLASSES:
            first, second = evaluations[first_side].precision[kind], evaluations[second_side].precision[kind]
            rows.append(_row("map50", kind, "", first_side, second_side, paired_change("map50", second, first, units)))
    for against, first_side, second_side in _compared_ipds(evaluations):
        for kind in BOX_CLASSES:
            changed = ipd_change(kind, evaluations[against], evaluations[second_side], evaluations[first_side])
            if changed["pairs"]:
                rows.append(
                    _row("ipd", kind, against[1], first_side, second_side, changed) | {"pairs": changed["pairs"]}
                )
    table = pd.DataFrame(rows, columns=list(DIFFERENCE_COLUMNS))
    return table.assign(images=len(any_evaluation.keys), units=units, unit=any_evaluation.options.resampled)


def _compared_precisions(
    evaluations: Mapping[tuple[str, str], DomainEvaluation],
) -> Iterator[tuple[tuple[str, str], tuple[str, str]]]:
    """Yield pairs of domains of each detector, then pairs of detectors on each domain; the first has equal domains."""
    same_domain = sorted(sides for sides in evaluations if sides[0] == sides[1])
    for side, same in product((0, 1), same_domain):
        yield from ((same, other) for other in sorted(evaluations) if other[side] == same[side] and other != same)


def _compared_ipds(
    evaluations: Mapping[tuple[str, str], DomainEvaluation],
) -> Iterator[tuple[tuple[str, str], tuple[str, str], tuple[str, str]]]:
    """Yield each domain with each pair of the remaining domains, for every detector."""
    for trained in sorted({trained for trained, _ in evaluations}):
        domains = sorted(evaluated for detector, evaluated in evaluations if detector == trained)
        for against in domains:
            for first, second in combinations([domain for domain in domains if domain != against], 2):
                yield (trained, against), (trained, first), (trained, second)


def _row(
    metric: str, kind: str, against: str, first: tuple[str, str], second: tuple[str, str], changed: Mapping[str, object]
) -> dict[str, object]:
    """Return a row. In `changed`, the second side of the comparison has the suffix `_twin`."""
    ends = ("", "_twin", "_change", "_change_low", "_change_high")
    values = [changed[f"{metric}{end}"] for end in ends]
    sides = dict(zip((*SIDE_COLUMNS, *OTHER_SIDES), (*first, *second), strict=True))
    return {"metric": metric, "kind": kind, "against": against, **sides, **dict(zip(_VALUES, values, strict=True))}

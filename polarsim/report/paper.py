"""The paper's two tables (Chen et al., POLAR-Sim, arXiv 2309.12397), and how domains are called beside them.

They concern rocks, real photos and 200 epochs from pre-trained weights. They stand beside our figures, never for them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

REAL, ANALOG, PRINCIPLED, HAPKE = "real", "analog", "principled", "hapke"
DOMAIN_ORDER = (REAL, ANALOG, PRINCIPLED, HAPKE)

# Table 1: (trained on, evaluated on) -> mAP@0.5, mAP@[0.5:0.95], IOU_mean
DETECTION = {
    (REAL, REAL): (0.987, 0.805, 0.849),
    (REAL, PRINCIPLED): (0.682, 0.320, 0.624),
    (REAL, HAPKE): (0.580, 0.261, 0.534),
    (PRINCIPLED, REAL): (0.662, 0.318, 0.513),
    (PRINCIPLED, PRINCIPLED): (0.893, 0.829, 0.893),
    (PRINCIPLED, HAPKE): (0.813, 0.664, 0.842),
    (HAPKE, REAL): (0.582, 0.269, 0.434),
    (HAPKE, PRINCIPLED): (0.887, 0.730, 0.872),
    (HAPKE, HAPKE): (0.887, 0.809, 0.898),
}

# Table 2: (trained on, the two domains compared) -> IPD, lower is better
PAIRS = ((PRINCIPLED, HAPKE), (REAL, HAPKE), (REAL, PRINCIPLED))
IPD = {
    (REAL, (REAL, HAPKE)): 0.3152,
    (REAL, (REAL, PRINCIPLED)): 0.2256,
    (PRINCIPLED, (PRINCIPLED, HAPKE)): 0.0511,
    (PRINCIPLED, (REAL, PRINCIPLED)): 0.3808,
    (HAPKE, (PRINCIPLED, HAPKE)): 0.0261,
    (HAPKE, (REAL, HAPKE)): 0.4638,
}

ANALOG_PICTURES_NOTE = "Analog pictures come from a simulated sandbox and are no photos."


def analog_notes(table: pd.DataFrame, columns: Sequence[str]) -> list[str]:
    """What has to be said first of a table some of whose columns name the analog as a domain."""
    return [ANALOG_PICTURES_NOTE] if any((table[name] == ANALOG).any() for name in columns) else []


def is_comparable(source: str) -> bool:
    """Whether a source's pictures show what the paper's did; only then do its figures stand beside ours."""
    return source != ANALOG


def with_own_names(table: pd.DataFrame, columns: Sequence[str], source: str) -> pd.DataFrame:
    """A copy of the table with the domains in some columns named by `own_name`."""
    names = {column: [own_name(str(domain), source) for domain in table[column]] for column in columns}
    return table.assign(**{column: pd.Series(values, table.index, dtype="str") for column, values in names.items()})


def own_name(domain: str, source: str) -> str:
    """A domain's name in our tables: what the analog sandbox made is never called real."""
    return ANALOG if domain == REAL and source == ANALOG else domain


def counterpart(domain: str) -> str:
    """The paper's domain that has our domain's role."""
    return REAL if domain == ANALOG else domain


def sorted_rows(table: pd.DataFrame, *keys: pd.Series | np.ndarray) -> pd.DataFrame:
    """The table by keys of its rows, of which the first counts most; rows that are alike stay in their order."""
    order = pd.DataFrame({number: np.asarray(key) for number, key in enumerate(keys)})
    return table.iloc[order.sort_values(list(order.columns), kind="stable").index].reset_index(drop=True)


def title(domain: str) -> str:
    return domain.replace("_", " ").capitalize()


def in_order(domains: set[str]) -> list[str]:
    """The paper's order, then all others by name."""
    return sorted(domains, key=lambda domain: (rank(domain), domain))


def rank(domain: str) -> int:
    return DOMAIN_ORDER.index(domain) if domain in DOMAIN_ORDER else len(DOMAIN_ORDER)


def ordered_pair(first: str, second: str) -> tuple[str, str]:
    """Two domains in the paper's order: IPD does not care."""
    one, other = sorted((first, second), key=lambda domain: (rank(domain), domain))
    return one, other

"""Tables 1 and 2 of Chen et al., POLAR-Sim, arXiv 2309.12397, and the names and order of domains in report tables.

The published values are of rocks in real photos, after 200 epochs from pre-trained weights.
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

ANALOG_PICTURES_NOTE = "Analog images are simulated; they are no photos."


def analog_notes(table: pd.DataFrame, columns: Sequence[str]) -> list[str]:
    """Return the note that analog images are no photos, if a column of domains contains the analog."""
    return [ANALOG_PICTURES_NOTE] if any((table[name] == ANALOG).any() for name in columns) else []


def is_comparable(source: str) -> bool:
    """Return whether the paper's values apply to the images of a source."""
    return source != ANALOG


def with_display_names(table: pd.DataFrame, columns: Sequence[str], source: str) -> pd.DataFrame:
    """Return a copy of the table with `display_name` applied to the columns of domains."""
    names = {column: [display_name(str(domain), source) for domain in table[column]] for column in columns}
    return table.assign(**{column: pd.Series(values, table.index, dtype="str") for column, values in names.items()})


def display_name(domain: str, source: str) -> str:
    """Return the name of a domain in report tables: images of the analog sandbox are never named "real"."""
    return ANALOG if domain == REAL and source == ANALOG else domain


def counterpart(domain: str) -> str:
    """Return the paper's domain that corresponds to a domain."""
    return REAL if domain == ANALOG else domain


def sorted_rows(table: pd.DataFrame, *keys: pd.Series | np.ndarray) -> pd.DataFrame:
    """Sort a table by keys (n,), the most significant first; the sort is stable."""
    order = pd.DataFrame({number: np.asarray(key) for number, key in enumerate(keys)})
    return table.iloc[order.sort_values(list(order.columns), kind="stable").index].reset_index(drop=True)


def domain_title(domain: str) -> str:
    return domain.replace("_", " ").capitalize()


def pair_title(first: str, second: str) -> str:
    return f"{domain_title(first)} - {domain_title(second)}"


def sorted_domains(domains: set[str]) -> list[str]:
    """Sort domains in the paper's order, followed by all other domains by name."""
    return sorted(domains, key=lambda domain: (domain_rank(domain), domain))


def domain_rank(domain: str) -> int:
    return DOMAIN_ORDER.index(domain) if domain in DOMAIN_ORDER else len(DOMAIN_ORDER)


def ordered_pair(first: str, second: str) -> tuple[str, str]:
    """Return two domains in the paper's order; IPD is symmetric."""
    a, b = sorted((first, second), key=lambda domain: (domain_rank(domain), domain))
    return a, b

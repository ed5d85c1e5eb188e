"""Columns of `gap/ablation.parquet` that its writer and its table share."""

from __future__ import annotations

FIGURES = ("ipd", "ipd_abs", "map50", "false_positives", "false_positive_area")
# Of the twin, of the other one, and what changes.
ENDS = ("_twin", "", "_change", "_change_low", "_change_high")
FIGURE_COLUMNS = tuple(f"{figure}{end}" for figure in FIGURES for end in ENDS)

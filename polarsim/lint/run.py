"""The linter as a whole: which form a tree has, which rules count, what is told and repaired."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats import release
from polarsim.lint.findings import Report
from polarsim.lint.pictures import is_picture_folder, lint_pictures
from polarsim.lint.release import lint_release
from polarsim.lint.repair import write_repaired
from polarsim.lint.rules import RULES


def lint(root: Path, names: Collection[str], *, workers: int = 1, fix: Path | None = None) -> Report:
    """Findings of some rules in a folder of the published layout, or in one of pictures and labels.

    Parameters
    ----------
    names
        Of the rules that count, see `rules.chosen`.
    fix
        Folder to which a repaired copy is written; the published layout only.

    Raises
    ------
    FormatError
        The folder is missing or of neither form, or no copy can be written.
    """
    root = Path(root)
    if is_picture_folder(root) and not release.terrains(root):
        if fix is not None:
            raise FormatError("repaired copies are written of the published layout only", path=root)
        return lint_pictures(root).chosen(names)
    report = lint_release(root, workers).chosen(names)
    if fix is not None:
        write_repaired(root, report.findings, fix)
    return report


def rule_lines() -> list[str]:
    """One line a rule, by code."""
    rows = sorted((rule.code, rule.severity, name, rule) for name, rule in RULES.items())
    return [
        f"{code}  {severity:7}  {name:22}  {rule.meaning}" + (f"; --fix {rule.repair}" if rule.repair else "")
        for code, severity, name, rule in rows
    ]

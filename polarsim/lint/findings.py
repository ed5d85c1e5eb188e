"""Findings of the linter: collected by file, counted, and written as text or JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from polarsim.errors import PolarsimError
from polarsim.formats.yolo import MalformedLinesError, fields_of
from polarsim.lint.rules import RULES, Defect, Severity
from polarsim.photo import PhotoKey
from polarsim.wording import counted

Content = TypeVar("Content")
MAX_LINES = 20  # maximum number of findings of malformed lines per file; a last finding has the number of others
_JSON_COLUMNS = ("code", "severity", "defect", "file", "line", "meaning", "detail", "repair")


@dataclass(frozen=True, order=True)
class Finding:
    """Defect of a file below the root."""

    file: str
    line: int  # the first line with the defect, from 1; 0 for defects of the entire file
    defect: str
    detail: str = ""
    rows: tuple[int, ...] = field(default=(), compare=False, repr=False)  # indices of all boxes or polygons with it
    lacking: tuple[tuple[float, ...], ...] = field(default=(), compare=False, repr=False)  # missing boxes

    @property
    def code(self) -> str:
        return RULES[self.defect].code

    @property
    def severity(self) -> Severity:
        return RULES[self.defect].severity

    @property
    def meaning(self) -> str:
        return RULES[self.defect].meaning

    @property
    def repair(self) -> str:
        return RULES[self.defect].repair

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}" if self.line else self.file
        detail = f": {self.detail}" if self.detail else ""
        return f"{where}: {self.code} {self.defect}{detail}"


@dataclass(frozen=True)
class Report:
    """Findings and contents of a tree of labels."""

    findings: list[Finding]
    contents: dict[str, dict[str, int]]  # part of the tree, such as a terrain -> kind of content -> number
    repairs: int | None = None  # number of findings that a repaired copy resolves; None without a copy

    def chosen(self, names: Collection[str]) -> Report:
        """Return a report with the findings of some rules only."""
        return replace(self, findings=[finding for finding in self.findings if finding.defect in names])

    @property
    def counts(self) -> dict[str, int]:
        """Number of findings by defect."""
        return dict(sorted(Counter(finding.defect for finding in self.findings).items()))

    def count(self, *severities: Severity) -> int:
        return sum(finding.severity in severities for finding in self.findings)

    def table(self, *columns: str) -> pd.DataFrame:
        """Return a row per finding with these attributes of the findings."""
        rows = [[getattr(finding, column) for column in columns] for finding in self.findings]
        return pd.DataFrame(rows, columns=list(columns))

    def as_json(self) -> dict[str, Any]:
        """Return `contents`, `findings` with code, severity, file, line, message and repair, and counts by severity."""
        return {
            "contents": self.contents,
            "findings": self.table(*_JSON_COLUMNS).to_dict("records"),
            "counts": self.counts,
            "errors": self.count("error"),
            "warnings": self.count("warning"),
            "notes": self.count("note"),
        }

    def as_text(self) -> str:
        """Return a line per finding, a line per rule with the number of its findings, and the numbers by severity."""
        order = sorted(self.counts.items(), key=lambda item: RULES[item[0]].code)
        lines = [f"{RULES[name].code}  {RULES[name].severity:7}  {name:22} {count:6}" for name, count in order]
        by_rule = ["", "findings by rule:", *lines] if order else []
        counts = f"{self.count('error')} errors, {self.count('warning')} warnings, {self.count('note')} notes"
        return "\n".join([*(f"{finding.severity}: {finding}" for finding in self.findings), *by_rule, counts])


@dataclass
class Findings:
    """Collects findings of files below a root."""

    root: Path
    gathered: list[Finding] = field(default_factory=list)

    def add(self, path: Path, defect: Defect) -> None:
        line = _line(path, defect.rows[0]) if defect.rows else 0
        file = path.relative_to(self.root).as_posix()
        self.gathered.append(Finding(file, line, defect.name, defect.detail, defect.rows, defect.lacking))

    def read(self, path: Path, reader: Callable[[Path], Content], name: str) -> Content | None:
        """Return the content of a file, or add a finding, for malformed lines one each, and return None."""
        try:
            return reader(path)
        except MalformedLinesError as error:
            defects = [(line.line or 0, line.reason) for line in error.lines[:MAX_LINES]]
            if others := error.lines[MAX_LINES:]:
                defects.append(
                    (others[0].line or 0, f"{counted(len(others), 'more line')}, the last is line {others[-1].line}")
                )
        except PolarsimError as error:
            here = error.path in (None, path)
            defects = [(error.line or 0, error.reason) if here else (0, str(error))]
        except OSError as error:
            defects = [(0, str(error))]
        file = path.relative_to(self.root).as_posix()
        self.gathered.extend(Finding(file, line, name, detail) for line, detail in defects)
        return None

    def read_all(self, files: Mapping[PhotoKey, Path], reader: Callable[[Path], Content]) -> dict[PhotoKey, Content]:
        """Return contents of the readable files, the same object for equal files; add findings for the rest."""
        contents: dict[PhotoKey, Content] = {}
        known: dict[bytes, Content] = {}
        for key, path in files.items():
            raw = self.read(path, Path.read_bytes, "malformed")
            if raw is None:
                continue
            content = known[raw] if raw in known else self.read(path, reader, "malformed")
            if content is not None:
                contents[key] = known[raw] = content
        return contents


def _line(path: Path, row: int) -> int:
    """Return the line from 1 of a row from 0; blank lines are not rows."""
    return fields_of(path)[row][0]

"""The gap ledger, where a run has one: its Markdown form is taken as it stands."""

from __future__ import annotations

import re

import pandas as pd

from polarsim.tables.section.pages import Block, Heading, Paragraph, Table

_CAPTION = re.compile(r"\*\*(.+)\*\*")
_BARE = re.compile(r"\\([|*_\\`<])")


def ledger_part(text: str | None) -> list[Block]:
    """Every table of `tables/gap.md` with its caption, and the notes between and below; nothing for None."""
    if text is None:
        return []
    blocks: list[Block] = [
        Heading("Causes of the gap"),
        Paragraph("The gap ledger replaces one ingredient of the twins at a time and says what changes."),
    ]
    caption, rows = "Gap ledger.", list[list[str]]()
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            rows.append(_cells(line))
            continue
        if rows:
            number = sum(isinstance(block, Table) for block in blocks) + 1
            blocks.append(Table(f"ledger-{number}", caption, pd.DataFrame(rows[2:], columns=rows[0])))
            rows = []
        if named := _CAPTION.fullmatch(line.strip()):
            caption = _BARE.sub(r"\1", named[1])
        elif line.strip():
            blocks.append(Paragraph(_BARE.sub(r"\1", line.strip()), note=True))
    return blocks


def _cells(line: str) -> list[str]:
    """Texts between the bars of a row, but those with a backslash before them."""
    return [_BARE.sub(r"\1", cell.strip()) for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]

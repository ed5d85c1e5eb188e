"""Write the tables of columns into pages: `python -m polarsim.schemas docs/tables.md docs/formats.md`.

A page has a line `<!-- columns of PATH -->` for each table and `<!-- end of columns -->` after its columns; `*` stands
for every table that no other line of the page names.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path

from polarsim.schemas import covers, detect, evaluation, photos, report, rover, stages
from polarsim.schemas.table import Table

REPORT_TABLES = (Table("tables", "Origin", report.ORIGIN), *report.TABLES)
STAGE_TABLES = tuple(table for module in (photos, stages, detect, covers, evaluation, rover) for table in module.TABLES)
_BLOCK = re.compile(r"(<!-- columns of (.+?) -->\n)(.*?)(<!-- end of columns -->)", re.DOTALL)


def filled_page(page: str) -> str:
    """Return a page with the columns of its tables."""
    known = {table.path: table for table in (*REPORT_TABLES, *STAGE_TABLES)}
    named = {found[2] for found in _BLOCK.finditer(page)}

    def columns(found: re.Match[str]) -> str:
        text = _sections(table for table in STAGE_TABLES if table.path not in named)
        return f"{found[1]}\n{text if found[2] == '*' else known[found[2]].markdown()}\n\n{found[4]}"

    return _BLOCK.sub(columns, page)


def _sections(tables: Iterable[Table]) -> str:
    return "\n\n".join(f"### `{table.path}`\n{table.row}.\n\n{table.markdown()}" for table in tables)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        path = Path(name)
        path.write_text(filled_page(path.read_text(encoding="utf-8")), encoding="utf-8")

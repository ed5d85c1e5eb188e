"""Write the tables of columns into pages: `python -m polarsim.schemas docs/tables.md docs/formats.md`.

A page has a line `<!-- columns of PATH -->` before and `<!-- end of columns -->` after the columns of each table. `*`
is replaced by all tables that are not named in the page.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

from polarsim.schemas import covers, detect, evaluation, photos, report, rover, stages
from polarsim.schemas.table import Table


def _tables(*modules: ModuleType) -> tuple[Table, ...]:
    """Return the tables of modules in the order of declaration."""
    return tuple(value for module in modules for value in vars(module).values() if isinstance(value, Table))


REPORT_TABLES = (Table("tables", "Origin", report.ORIGIN), *_tables(report))
STAGE_TABLES = _tables(photos, stages, detect, covers, evaluation, rover)
_BLOCK = re.compile(r"(<!-- columns of (.+?) -->\n)(.*?)(<!-- end of columns -->)", re.DOTALL)


def filled_page(page: str) -> str:
    """Return a page with the columns of the tables filled in."""
    table_of_path = {table.path: table for table in (*REPORT_TABLES, *STAGE_TABLES)}
    named = {match[2] for match in _BLOCK.finditer(page)}

    def columns(match: re.Match[str]) -> str:
        text = _sections(table for table in STAGE_TABLES if table.path not in named)
        return f"{match[1]}\n{text if match[2] == '*' else table_of_path[match[2]].markdown()}\n\n{match[4]}"

    return _BLOCK.sub(columns, page)


def _sections(tables: Iterable[Table]) -> str:
    return "\n\n".join(f"### `{table.path}`\n{table.row}.\n\n{table.markdown()}" for table in tables)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        path = Path(name)
        path.write_text(filled_page(path.read_text(encoding="utf-8")), encoding="utf-8")

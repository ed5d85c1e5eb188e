"""Each row of the tables in CONTRIBUTING.md has at most three files; files and names exist."""

import ast
import re
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parent.parent
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (CHECKOUT / "CONTRIBUTING.md").read_text().splitlines()
    if line.startswith("|") and line.count("|") == 4 and "`" in line
]


def defined(file: Path) -> set[str]:
    """Return the functions, classes, methods, constants, option keys and rules that a file defines."""
    text = file.read_text()
    if file.suffix == ".smk":
        return set(re.findall(r"^\s*rule (\w+):", text, re.MULTILINE))
    if file.suffix != ".py":
        return set(re.findall(r"\w+", text))
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        names |= {part.id for target in targets if target for part in ast.walk(target) if isinstance(part, ast.Name)}
    return names


@pytest.mark.parametrize(("task", "files", "names"), ROWS, ids=[row[0][:60] for row in ROWS])
def test_a_task_needs_at_most_three_files_that_define_the_names(task, files, names):
    paths = [CHECKOUT / file for file in re.findall(r"`([\w/.]+)`", files)]
    assert 1 <= len(paths) <= 3
    assert [path for path in paths if not path.exists()] == []
    known = set().union(*(defined(path) for path in paths if path.is_file()))
    assert set(re.findall(r"`(\w+)`", names)) <= known

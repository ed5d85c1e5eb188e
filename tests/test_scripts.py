"""A script uses every file and option of its rule; tests/workflow/test_job_values.py runs the scripts."""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

WORKFLOW = Path(__file__).parents[1] / "workflow"
SECTIONS = ("input", "output", "params")
DIGESTS = {"code", "packaged"}  # params that only repeat a job
DECLARED = {  # names of the files of functions in workflow/rules/common.smk, from the names of their arguments
    "table_files": lambda given, first: (
        {name: first for name in (*given, "others") if name != first}
        | ({first: None} if first else {"others": given[0]})
    ),
    "position_figures": lambda *_: {"comparisons": None, "contacts": None},
}
THROUGH = re.compile(r"# (?:read|written) through ([\w.]+)")


@dataclass(frozen=True)
class Rule:
    """Names in a rule by section, each with the name from which a function derives the files."""

    script: str | None
    sections: dict[str, dict[str, str | None]]


def entries(block: str) -> dict[str, str | None]:
    """Return the names of a section, each with the name from which the files are derived according to a comment.

    The names of a `**` expression are `*`.
    """
    found: dict[str, str | None] = {}
    through = None
    (indent,) = re.findall(r"\A *", block)
    for line in block.splitlines():
        comment = THROUGH.search(line)
        if entry := re.match(rf"{indent}(\w+)=", line):
            found[entry[1]] = comment[1] if comment else through
            through = None
        elif line.startswith(f"{indent}**"):
            named = DECLARED.get(line.split("(")[0].strip(" *"), lambda *_: {"*": None})
            found |= named(re.findall(r"(\w+)=", block[block.index(line) :].partition(")")[0]), through)
            through = None
        elif line.startswith(f"{indent}#"):
            through = comment[1] if comment else None
        else:
            assert not re.match(rf"{indent}[\w\"'*]", line), f"{line.strip()}: without name"
    return found


def rules() -> dict[str, Rule]:
    """Return all rules by name; a `use rule` inherits script and sections unless it replaces them."""
    found: dict[str, Rule] = {}
    blocks = [
        block
        for path in sorted((WORKFLOW / "rules").glob("*.smk"))
        for block in re.split(r"^(?=\s*(?:use )?rule \w+.*:$)", path.read_text(), flags=re.MULTILINE)
    ]
    for block in sorted(blocks, key=lambda block: "use rule" in block):
        head = re.match(r"\s*(?:use rule (\w+) as (\w+) with|rule (\w+)):", block)
        script = re.search(r'"\.\./scripts/(\w+)\.py"', block)
        if not head or not (head[1] or script):
            continue
        sections = dict(found[head[1]].sections if head[1] else {})
        for section in SECTIONS:
            if part := re.search(rf"^( +){section}:\n((?:\1    .*\n)+)", block, re.MULTILINE):
                sections[section] = entries(part[2])
        name, base = head[2] or head[3], found[head[1]].script if head[1] else script[1]
        found[name] = Rule(base, sections)
    return found


RULES = rules()


def used_by(script: str) -> set[str]:
    """Return the items of the rule that a script uses: `input.photos`; `input.*` for inputs that are not named."""
    found = set()
    for node in ast.walk(ast.parse((WORKFLOW / f"scripts/{script}.py").read_text())):
        parts = ast.unparse(node).split(".") if isinstance(node, ast.Attribute) else []
        if parts[:1] == ["snakemake"] and len(parts) == 3:
            found.add(".".join([parts[1], "*" if parts[2] in ("items", "get") else parts[2]]))
    return found


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_a_script_uses_every_file_and_param_of_its_rule_or_the_rule_states_how_it_is_derived(rule):
    used = used_by(rule.script)
    for section in SECTIONS:
        for name, through in rule.sections.get(section, {}).items():
            if name in DIGESTS and section == "params":
                continue
            if through is None:
                assert {f"{section}.{name}", f"{section}.*"} & used, f"{section} {name} is not used"
            else:
                assert f"{section}.{name}" not in used, f"{section} {name} is used, not found through {through}"
                others = {through} if "." in through else {f"{other}.{through}" for other in ("input", "output")}
                assert others & used, f"{section} {name}: {through} is not used"

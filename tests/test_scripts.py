"""A script passes every file of the rule by name: no argument is missing, misspelt or unused."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest

WORKFLOW = Path(__file__).parents[1] / "workflow"
SCRIPTS = sorted(path.stem for path in (WORKFLOW / "scripts").glob("*.py"))
SECTIONS = ("input", "output", "params")
DIGESTS = {"code", "packaged"}  # params that only repeat a job
CONVERTED = {"paths", "optional_path"}
THROUGH = re.compile(r"# (?:read|written) through ([\w.]+)")


@dataclass(frozen=True)
class Rule:
    """Names in a rule by section, each with the name from which a function derives the files, and wildcards."""

    name: str
    script: str | None
    sections: dict[str, dict[str, str | None]]
    wildcards: frozenset[str]


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
            found["*"] = None
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
        found[name] = Rule(name, base, sections, frozenset(re.findall(r"(?<=\{)(\w+)(?=\})", block)))
    return found


RULES = rules()


def tree_of(script: str) -> ast.Module:
    return ast.parse((WORKFLOW / f"scripts/{script}.py").read_text())


def used_by(script: str) -> set[str]:
    """Return the items of the rule that a script uses: `input.photos`; `input.*` for all inputs."""
    found = set()
    for node in ast.walk(tree_of(script)):
        parts = ast.unparse(node).split(".") if isinstance(node, ast.Attribute) else []
        if parts[:1] == ["snakemake"] and len(parts) == 3:
            found.add(".".join([parts[1], "*" if parts[2] == "items" else parts[2]]))
    return found


def calls_of(script: str) -> Iterator[tuple[object, ast.Call]]:
    """Yield the functions and classes of polarsim that a script calls, with the calls."""
    tree = tree_of(script)
    imported = {
        alias.name: getattr(import_module(node.module), alias.name)
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module.startswith("polarsim.")
        for alias in node.names
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and (name := ast.unparse(node.func)) in imported and name not in CONVERTED:
            yield imported[name], node


def test_every_script_has_a_rule_and_every_rule_has_a_script():
    assert {rule.script for rule in RULES.values()} == set(SCRIPTS)
    assert len(SCRIPTS) > 80


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_is_a_list_of_calls_with_named_arguments(script):
    (block,) = [node for node in tree_of(script).body if not isinstance(node, ast.Expr | ast.ImportFrom)]
    assert ast.unparse(block).startswith("with reporting(log=snakemake.log[0]):")
    called = {ast.unparse(node.func): (function, node) for function, node in calls_of(script)}
    for call in block.body:
        assert isinstance(call.value, ast.Call)
        function, node = called[ast.unparse(call.value.func)]
        assert not node.args
        signature(function).bind(**{word.arg: word.value for word in node.keywords})  # complete and without misspelling


@pytest.mark.parametrize("script", SCRIPTS)
def test_classes_and_functions_for_arguments_accept_the_arguments(script):
    for function, node in calls_of(script):
        named = {word.arg: word.value for word in node.keywords if word.arg}
        if len(named) == len(node.keywords):
            signature(function).bind(*node.args, **named)
        else:  # `Options(**...)`: the model rejects unknown names
            assert named.keys() <= signature(function).parameters.keys()
            assert function.model_config["extra"] == "forbid"


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_a_rule_defines_every_item_of_its_script(rule):
    named = {f"{section}.{name}" for section, names in rule.sections.items() for name in names}
    named |= {f"wildcards.{name}" for name in rule.wildcards}
    used = used_by(rule.script)
    every = {name.removesuffix("*") for name in used if name.endswith(".*")}  # mappings: of any name
    assert {name for name in used - named if not name.endswith(".*")} == set()
    assert all(any(name.startswith(section) for name in named) for section in every)


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

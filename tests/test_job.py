"""A job's function gets what its rule names, as what it is annotated with."""

import ast
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from inspect import Parameter, signature
from pathlib import Path

import pytest
from pydantic import BaseModel, ValidationError
from snakemake.iocontainers import InputFiles, Log, OutputFiles, Params, Snakemake, Wildcards

from polarsim.errors import PolarsimError
from polarsim.job import job

WORKFLOW = Path(__file__).parents[1] / "workflow"


class Options(BaseModel, extra="forbid"):
    cell_mm: float = 3


def named(kind: type, **parts: object) -> object:
    """Files or params as Snakemake hands them to a script: lists under one name are lists of its own."""
    found = kind()
    for name, part in parts.items():
        start = len(found)
        several = isinstance(part, list)
        found.extend(part if several else [part])
        found._set_name(name, start, len(found) if several else None)
    return found


@pytest.fixture
def snakemake(tmp_path: Path) -> Snakemake:
    return Snakemake(
        input_=named(InputFiles, tables=["a.parquet", "b.parquet"], photos=[], rocks="rocks"),
        output=named(OutputFiles, merged="out/merged.parquet", rocks="found"),
        params=named(Params, options={"cell_mm": 5}, models=["hapke"]),
        wildcards=named(Wildcards, terrain="08", merged="none"),
        threads=2,
        resources={},
        log=Log([str(tmp_path / "logs/job.log")]),
        config={},
        rulename="merge",
        bench_iteration=None,
    )


def test_arguments_are_found_by_name_and_made_what_they_are_annotated_with(snakemake):
    def merge(
        terrain: int,
        tables: Sequence[Path],
        merged: Path,
        options: Options,
        models: list[str],
        threads: int,
        width: int = 7,
    ) -> tuple:
        return terrain, tables, merged, options, models, threads, width

    with job(snakemake) as call:
        terrain, tables, merged, options, models, threads, width = call(merge)
    assert (terrain, threads, width) == (8, 2, 7)
    assert list(tables) == [Path("a.parquet"), Path("b.parquet")]
    assert merged == Path("out/merged.parquet")  # a file, before the wildcard
    assert options == Options(cell_mm=5)
    assert models == ["hapke"]


def test_a_list_of_one_file_is_that_file_where_no_list_is_taken(snakemake):
    def draw(models: str | None, rocks: Path) -> tuple:
        return models, rocks

    def gather(models: Sequence[str], rocks: Path, tables: Path | None = None) -> tuple:
        return models, rocks, tables

    with job(snakemake) as call:
        assert call(draw, rocks="found") == ("hapke", Path("found"))
        assert call(gather, rocks=["found"], tables=None) == (["hapke"], Path("found"), None)
        with pytest.raises(ValidationError, match="not a valid path"):
            call(gather, rocks="found")  # two files are not one


def test_what_is_given_goes_before_what_the_rule_names(snakemake):
    def score(rocks: Path, by_terrain: Mapping[int, Path]) -> tuple:
        return rocks, by_terrain

    with job(snakemake) as call:
        found = call(score, rocks=snakemake.output.rocks, by_terrain={1: "one"})
    assert found == (Path("found"), {1: Path("one")})


def test_no_file_is_none_where_an_argument_may_be_none(snakemake):
    def fit(photos: Path | None) -> Path | None:
        return photos

    def fit_all(photos: list[Path]) -> list[Path]:
        return photos

    with job(snakemake) as call:
        assert call(fit) is None
        assert call(fit_all) == []


def test_a_name_that_stands_twice_must_be_given(snakemake):
    def mesh(rocks: Path) -> Path:
        return rocks

    with job(snakemake) as call, pytest.raises(TypeError, match="merge: rocks stands for 2"):
        call(mesh)


def test_an_argument_that_a_function_does_not_have_is_refused(snakemake):
    def thin(terrain: int) -> int:
        return terrain

    with job(snakemake) as call, pytest.raises(TypeError, match="cell_mm"):
        call(thin, cell_mm=3)


def test_an_error_of_polarsim_ends_a_job_in_one_line_and_stands_in_its_log(snakemake, capsys):
    def fail(terrain: int) -> None:
        raise PolarsimError(f"terrain {terrain} has no scan")

    with pytest.raises(SystemExit), job(snakemake) as call:
        call(fail)
    assert capsys.readouterr().err.splitlines()[-1] == "error: terrain 8 has no scan"
    assert "terrain 8 has no scan" in Path(snakemake.log[0]).read_text()


def rules_by_script() -> dict[str, list[str]]:
    """Text of the rules that run a script, by its name."""
    found: dict[str, list[str]] = {}
    for path in sorted((WORKFLOW / "rules").glob("*.smk")):
        for block in re.split(r"^(?=\s*(?:use )?rule \w+.*:$)", path.read_text(), flags=re.MULTILINE):
            if script := re.search(r'"\.\./scripts/(\w+)\.py"', block):
                found.setdefault(script[1], []).append(block)
    return found


def names_in(rule: str, section: str) -> set[str]:
    """Names of a rule's inputs, outputs or params."""
    found = re.search(rf"^( +){section}:\n((?:\1    .*\n)+)", rule, re.MULTILINE)
    return set(re.findall(rf"^{found[1]}    (\w+)=", found[2], re.MULTILINE)) if found else set()


def calls_of(script: str) -> list[tuple[str, str, set[str]]]:
    """Module and name of each function that a script calls through its job, and the arguments that it gives."""
    tree = ast.parse((WORKFLOW / f"scripts/{script}.py").read_text())
    modules = {
        alias.name: node.module for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "call"]
    return [(modules[node.args[0].id], node.args[0].id, {word.arg for word in node.keywords}) for node in nodes]


@pytest.mark.parametrize(
    ("script", "rule"), [(script, rule) for script, rules in sorted(rules_by_script().items()) for rule in rules]
)
def test_a_rule_names_once_what_its_script_does_not_give(script, rule):
    wildcards = set(re.findall(r"\{(\w+)\}", rule)) | {"threads"}
    sections = [names_in(rule, section) for section in ("output", "input", "params")]
    assert calls_of(script)
    for module, name, given in calls_of(script):
        function = getattr(import_module(module), name)
        assert given <= signature(function).parameters.keys()
        for argument, parameter in signature(function).parameters.items():
            named = sum(argument in section for section in sections)
            if argument not in given and not isinstance(function, type):  # of a class the tables are named in a loop
                assert named <= 1, f"{name}: {argument} stands for {named} files or params"
                assert named or argument in wildcards or parameter.default is not Parameter.empty, f"{name}: {argument}"

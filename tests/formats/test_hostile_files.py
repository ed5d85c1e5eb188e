"""Damaged files for every reader; `make fuzz` gives each 10,000."""

import importlib
import inspect
import pkgutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import polarsim
from benchmarks.fuzz import CASES, DAMAGES, Outcome, harm, valid
from benchmarks.fuzz_parsers import CORPUS, parse, parsers
from polarsim.formats.readers import READERS

FORMS = [(name, number) for name, cases in CASES.items() for number in range(len(cases))]
IN_MEMORY = ("decode", "parse_header", "from_text", "from_runs", "fields_of")


def readers():
    """Every function that reads: those that are marked, and those that are named so."""
    for package in ("formats", "acquire"):
        root = importlib.import_module(f"polarsim.{package}")
        for module in pkgutil.iter_modules(root.__path__, f"{root.__name__}."):
            for name, function in inspect.getmembers(importlib.import_module(module.name), inspect.isfunction):
                if function.__module__ == module.name and (name.startswith("read_") or name in IN_MEMORY):
                    yield f"{module.name}.{name}"
    yield from READERS


def test_every_reader_has_a_file_that_is_damaged():
    assert {name.removeprefix(f"{polarsim.__name__}.") for name in readers()} == set(CASES)


@pytest.mark.parametrize(("name", "number"), FORMS, ids=[f"{name}-{number}" for name, number in FORMS])
def test_a_damaged_file_is_a_sound_object_or_one_line(name, number, tmp_path):
    case, outcome = CASES[name][number], Outcome()
    with valid(case, tmp_path) as (source, whole):

        @settings(max_examples=100, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
        @given(st.sampled_from(list(whole)), DAMAGES)
        def damaged(path, damage):
            harm(case, source, path, whole[path], damage, outcome)

        damaged()
    assert outcome.refused > 0


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*/*")), ids=lambda path: f"{path.parent.name}-{path.name}")
def test_what_fuzzing_starts_from_breaks_no_parser(path, tmp_path):
    parse(path.parent.name, path.read_bytes(), tmp_path)


def test_every_parser_has_something_to_start_from():
    assert {path.name for path in CORPUS.iterdir()} == set(parsers())

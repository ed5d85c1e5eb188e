"""Damaged files for every reader: 50 of each form, or the number in FUZZ_EXAMPLES (`make fuzz`: 10,000)."""

import importlib
import inspect
import os
import pkgutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import polarsim
from polarsim.formats.readers import READERS
from tests.support.hostile_files import CASES, DAMAGES, damaged_is_refused, garbage_is_refused, valid

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "50"))

FORMS = [(name, number) for name, cases in CASES.items() for number in range(len(cases))]
IN_MEMORY = ("decode", "parse_header", "from_text", "from_runs", "fields_of")


def readers():
    """Yield the names of all readers: decorated functions, and functions with the name of a reader."""
    for package in ("formats", "run_files", "acquire"):
        root = importlib.import_module(f"polarsim.{package}")
        for module in pkgutil.iter_modules(root.__path__, f"{root.__name__}."):
            for name, function in inspect.getmembers(importlib.import_module(module.name), inspect.isfunction):
                if function.__module__ == module.name and (name.startswith("read_") or name in IN_MEMORY):
                    yield f"{module.name}.{name}"
    yield from READERS


def test_every_reader_has_a_case():
    assert {name.removeprefix(f"{polarsim.__name__}.") for name in readers()} == set(CASES)


@pytest.mark.parametrize(("name", "number"), FORMS, ids=[f"{name}-{number}" for name, number in FORMS])
def test_a_damaged_file_gives_a_valid_object_or_a_one_line_error(name, number, tmp_path):
    case = CASES[name][number]
    with valid(case, tmp_path) as (source, contents):

        @settings(max_examples=EXAMPLES, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
        @given(st.sampled_from(list(contents)), DAMAGES)
        def damaged(path, damage):
            damaged_is_refused(case, source, path, contents[path], damage)

        damaged()
        garbage = [garbage_is_refused(case, source, path, content) for path, content in contents.items()]
    assert any(garbage)  # the drawn damages may all be harmless

"""Damaged files for every reader: 100 of each form, or as many as FUZZ_EXAMPLES sets (`make fuzz`: 10,000)."""

import importlib
import inspect
import os
import pkgutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import polarsim
from polarsim.formats.readers import READERS
from tests.support.hostile_files import CASES, DAMAGES, damaged_is_refused, valid

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "100"))

FORMS = [(name, number) for name, cases in CASES.items() for number in range(len(cases))]
IN_MEMORY = ("decode", "parse_header", "from_text", "from_runs", "fields_of")


def readers():
    """Every function that reads: those that are marked, and those that are named so."""
    for package in ("formats", "run_files", "acquire"):
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
    case, refused = CASES[name][number], []
    with valid(case, tmp_path) as (source, whole):

        @settings(max_examples=EXAMPLES, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
        @given(st.sampled_from(list(whole)), DAMAGES)
        def damaged(path, damage):
            refused.append(damaged_is_refused(case, source, path, whole[path], damage))

        damaged()
    assert any(refused)

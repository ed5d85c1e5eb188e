"""A job's function gets what its rule names, as what it is annotated with."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from pydantic import BaseModel
from snakemake.iocontainers import InputFiles, Log, OutputFiles, Params, Snakemake, Wildcards

from polarsim.errors import PolarsimError
from polarsim.job import job


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


def test_an_error_of_polarsim_ends_a_job_in_one_line_and_stands_in_its_log(snakemake, capsys):
    def fail(terrain: int) -> None:
        raise PolarsimError(f"terrain {terrain} has no scan")

    with pytest.raises(SystemExit), job(snakemake) as call:
        call(fail)
    assert capsys.readouterr().err.splitlines()[-1] == "error: terrain 8 has no scan"
    assert "terrain 8 has no scan" in Path(snakemake.log[0]).read_text()

"""Overhead of Snakemake."""

import pytest


@pytest.mark.slow
def test_snakemake_looks_for_jobs_when_one_has_ended_and_not_by_the_clock(checkout, snakemake):
    targets = "results/demo/figures/reflectance.png", "results/demo/detect/position/split.csv"
    done = snakemake(checkout, *targets, "--verbose")
    assert done.returncode == 0, done.stderr
    jobs = done.stderr.count("Finished jobid")
    assert jobs == 3
    assert done.stderr.count("Ready jobs:") <= jobs + 1

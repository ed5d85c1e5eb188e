#!/usr/bin/env bash
# What `make dev` puts into .venv, into a Conda environment. The rules set POLARSIM_CLONE, the folder of this workflow.
set -euo pipefail
cd "${POLARSIM_CLONE:?the workflow is no clone on this machine: install polarsim in the environment of Snakemake}"
lock=requirements-dev.lock
torch=$(grep '^torch==' "$lock")
python -m pip install --quiet --disable-pip-version-check "$torch"
grep -v '^torch==' "$lock" |
    xargs -d '\n' -n 40 -P 2 python -m pip install --quiet --disable-pip-version-check --no-deps
python -m pip install --quiet --disable-pip-version-check --no-deps --editable .

#!/usr/bin/env bash
# What `make dev` puts into .venv, into a Conda environment; started in the clone.
set -euo pipefail
lock=requirements-dev.lock
torch=$(grep '^torch==' "$lock")
python -m pip install --quiet --disable-pip-version-check "$torch"
grep -v '^torch==' "$lock" |
    xargs -d '\n' -n 40 -P 2 python -m pip install --quiet --disable-pip-version-check --no-deps
python -m pip install --quiet --disable-pip-version-check --no-deps --editable .

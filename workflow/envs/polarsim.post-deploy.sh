#!/usr/bin/env bash
# What workflow/setup.sh puts into .venv, into a Conda environment; started in the clone.
set -euo pipefail
torch=$(grep '^torch==' requirements.lock)
python -m pip install --quiet --disable-pip-version-check "$torch"
grep -v '^torch==' requirements.lock |
    xargs -n 40 -P 2 python -m pip install --quiet --disable-pip-version-check --no-deps
python -m pip install --quiet --disable-pip-version-check --no-deps --editable .

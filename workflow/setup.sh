#!/usr/bin/env bash
# Makes .venv with everything that a lock pins, or adds it, and checks the system libraries that Open3D links to.
# Usage: workflow/setup.sh [python [lock]]
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:-python3}
lock=${2:-requirements.lock}

"$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 15))' || {
    echo "error: $python is $("$python" --version 2>&1), polarsim needs Python 3.11 to 3.14 (make setup PYTHON=python3.12)" >&2
    exit 1
}

libraries="libusb-1.0.so.0:libusb-1.0-0 libGL.so.1:libgl1 libEGL.so.1:libegl1 libX11.so.6:libx11-6 libudev.so.1:libudev1 libidn2.so.0:libidn2-0"
missing=""
for pair in $libraries; do
    ldconfig -p 2>/dev/null | grep -q "${pair%%:*}" || missing="$missing ${pair##*:}"
done
if [ -n "$missing" ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        # shellcheck disable=SC2086
        apt-get install -y --no-install-recommends $missing >/dev/null ||
            { apt-get update >/dev/null && apt-get install -y --no-install-recommends $missing >/dev/null; }
    else
        echo "error: Open3D needs system libraries that are not here: apt-get install$missing (or your system's like)" >&2
        exit 1
    fi
fi

[ -x .venv/bin/python ] || "$python" -m venv .venv
# Torch first and with its dependencies: on a machine with CUDA it brings those libraries, elsewhere pip may know a CPU build.
torch=$(grep '^torch==' "$lock")
.venv/bin/python -m pip install --quiet --disable-pip-version-check "$torch"
# A lock is complete, and Ultralytics must not pull in opencv-python, which overwrites the headless build: no
# dependencies. So the order is free, and two at a time take three fifths of the time.
grep -v '^torch==' "$lock" |
    xargs -d '\n' -n 40 -P 2 .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps
.venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
echo "ready: .venv/bin/polarsim, .venv/bin/snakemake"

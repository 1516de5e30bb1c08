#!/bin/sh
# Installs into $VENV what benchmarks/planner compares with; where it cannot, the benchmark tells what it leaves out.
set -eu
if [ -n "${UV:-}" ]; then
    install="$UV pip install --quiet --python $VENV"
else
    install="$VENV/bin/python -m pip install --quiet --disable-pip-version-check"
fi
if $install --require-hashes -r requirements-peers.txt; then
    touch "$VENV/.peers"
else
    echo "The peers could not be installed; benchmarking without them." >&2
fi

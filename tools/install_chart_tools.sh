#!/bin/sh
# Installs into .chart_tools what tests/chart renders and checks deploy/helm/skyway with.
set -eu
uv=$(command -v uv 2>/dev/null || true)
if [ -n "$uv" ]; then
    "$uv" pip install --quiet --python .venv --target .chart_tools --require-hashes -r requirements-chart.txt
else
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --upgrade \
        --target .chart_tools --require-hashes -r requirements-chart.txt
fi

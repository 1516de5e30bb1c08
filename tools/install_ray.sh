#!/bin/sh
# Installs into .venv what skyway[ray] needs; tests/library/test_workers.py starts two nodes.
set -eu
uv=$(command -v uv 2>/dev/null || true)
if [ -n "$uv" ]; then
    "$uv" pip install --quiet --python .venv --require-hashes -r requirements-ray.txt
else
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes \
        -r requirements-ray.txt
fi

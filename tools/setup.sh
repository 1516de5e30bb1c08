#!/bin/sh
# Makes the environment $VENV from the hashed requirements: with uv where it is on PATH, else venv and pip.
set -eu
if [ -n "${UV:-}" ]; then
    "$UV" venv --quiet --allow-existing --python ">=3.11" "$VENV"
    "$UV" pip install --quiet --python "$VENV" --require-hashes -r requirements.txt
    "$UV" pip install --quiet --python "$VENV" --no-deps --no-build-isolation -e .
else
    if ! python3 -c 'import sys; raise SystemExit(sys.version_info < (3, 11))'; then
        echo "Skyway needs python3 3.11 or newer; this is $(python3 --version)." >&2
        exit 1
    fi
    if ! python3 -c 'import ensurepip' 2>/dev/null; then
        echo "python3 cannot make virtual environments here: apt install python3-venv" >&2
        exit 1
    fi
    python3 -m venv "$VENV"
    "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.txt
    "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
fi

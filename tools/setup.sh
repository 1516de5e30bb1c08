#!/bin/sh
# Makes the environment $VENV and installs what running Skyway needs; with `developers`, what its developers need too.
# Everything comes from the hashed requirements, by uv: the one on PATH, or one that pip puts into the environment.
set -eu
step() { sh tools/step.sh "$@"; }
if [ "${1:-}" = developers ]; then
    step 1/1 "Installing the packages for developers" sh tools/install.sh -r requirements.txt
    exit
fi
if command -v uv >/dev/null; then
    step 1/4 "Making the environment" uv venv --quiet --allow-existing --python ">=3.11" "$VENV"
else
    if ! python3 -c 'import sys; raise SystemExit(sys.version_info < (3, 11))'; then
        echo "Skyway needs python3 3.11 or newer; this is $(python3 --version)." >&2
        exit 1
    fi
    if ! python3 -c 'import ensurepip' 2>/dev/null; then
        echo "python3 cannot make virtual environments here: apt install python3-venv" >&2
        exit 1
    fi
    step 1/4 "Making the environment" sh -c 'python3 -m venv "$VENV" && "$VENV/bin/python" -m pip install -qq \
        --disable-pip-version-check --require-hashes --only-binary :all: -r requirements-uv.txt'
fi
step 2/4 "Installing the packages" sh tools/install.sh -r requirements-run.txt
step 3/4 "Installing Skyway" sh tools/install.sh

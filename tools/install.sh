#!/bin/sh
# install.sh -r FILE ...: installs hashed requirements into $VENV; without arguments, Skyway itself.
# If uv fails, pip tries: it knows the settings of a machine that reaches packages through a mirror.
set -eu
VENV=${VENV:-.venv}
if [ "$#" -gt 0 ]; then set -- --require-hashes "$@"; else set -- --no-deps --no-build-isolation -e .; fi
if command -v uv >/dev/null; then
    uv pip install --quiet --python "$VENV" "$@"
else
    "$VENV/bin/uv" pip install --quiet --python "$VENV" "$@" ||
        "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
fi

"""Every public path serves somebody: console or command line use it, or a guide names it."""

import json
import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PATHS = sorted(json.loads((ROOT / "openapi/gateway.json").read_text())["paths"])


def users_and_guides() -> Iterator[str]:
    """The console's own scripts, the command line, and the guides."""
    console = ROOT / "gateway/skyway_console/console"
    scripts = (each for each in console.rglob("*.js") if "vendor" not in each.parts)
    guides = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    for file in chain(scripts, (ROOT / "skyway/cli").rglob("*.py"), guides):
        yield file.read_text(encoding="utf-8")


TEXT = "\n".join(users_and_guides())


def is_named(path: str, text: str) -> bool:
    """Whether a text has this path, with anything in place of each ``{name}``."""
    some = r"(?:\$\([^)]*\)|[^/\s]+(?=[/\s]|$))"  # a shell's $(...) may have spaces
    parts = (some if part.startswith("{") else re.escape(part) for part in path.split("/"))
    return re.search("/".join(parts) + r"(?![\w-]|/)", text) is not None


@pytest.mark.parametrize("path", PATHS)
def test_a_public_path_is_used_or_named_in_a_guide(path: str) -> None:
    assert is_named(path, TEXT)


def test_a_longer_path_does_not_name_a_shorter_one() -> None:
    path = "/v1/quotes/{quote_id}"

    assert is_named(path, 'api "/v1/quotes/$(get quote.json quote_id)" "$customer"')
    assert is_named(path, "GET /v1/quotes/{id}.")
    assert not is_named(path, "/v1/quotes and /v1/quotes/{quote_id}/offers")

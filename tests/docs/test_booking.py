"""docs/reference/booking.md names every state that the published documents name."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/reference/booking.md").read_text()
DOCUMENTS = [json.loads(path.read_text()) for path in sorted((ROOT / "openapi").glob("*.json"))]


def enums_in(value: Any) -> Iterator[list[str]]:
    """Every list of allowed texts in a JSON document."""
    if isinstance(value, dict):
        if isinstance(value.get("enum"), list):
            yield value["enum"]
        for inner in value.values():
            yield from enums_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from enums_in(inner)


@pytest.mark.parametrize(
    "needed",
    [
        {"REQUESTED", "PLANNED"},
        {"CREATED", "STRANDED"},
        {"BOOKED", "REFUSED"},
        {"REGISTERED", "GROUNDED"},
    ],
    ids=["delivery", "package", "mission", "drone"],
)
def test_the_page_names_every_state(needed: set[str]) -> None:
    states = {
        state
        for document in DOCUMENTS
        for enum in enums_in(document)
        if needed <= set(enum)
        for state in enum
    }

    assert states
    assert not {state for state in states if state not in PAGE}

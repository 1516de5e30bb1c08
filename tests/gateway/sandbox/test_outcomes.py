"""Each outcome of the sandbox, by its reference and by its station."""

from pathlib import Path

import pytest
from skyway_gateway.sandbox.outcomes import OUTCOMES, Outcome

from tests.gateway.sandbox.played import (
    accepted,
    played,
    request_for,
    sandbox_caller,
)
from tests.gateway.whole_gateway import Gateway

_QUICK = [each for each in OUTCOMES if each.name != "busy"]


@pytest.mark.parametrize("outcome", _QUICK, ids=lambda each: each.name)
async def test_a_reference_forces_its_outcome(gateway: Gateway, outcome: Outcome) -> None:
    headers = await sandbox_caller(gateway)
    body = request_for(outcome, reference=outcome.reference)

    delivery_id = await accepted(gateway, headers, body)

    assert (await played(gateway, headers, delivery_id))["state"] == outcome.ends_as


def test_the_page_has_every_outcome_as_the_code_has_it() -> None:
    page = (Path(__file__).parents[3] / "docs/sandbox.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `test_")]

    assert rows == [
        f"| `{each.reference}` | `{each.station_id}` | {each.ends_as} | {each.about} |"
        for each in OUTCOMES
    ]

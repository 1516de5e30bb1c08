"""The plans that a drone was sent in a past span, for replays."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
PATH = "/v1/drones/drn_1/plans"


@pytest.fixture
async def flying(composition: Any, drone: Any, make: Any) -> Any:
    """A drone that has accepted a mission to c."""
    await composition.book(make.candidate(1), request=make.request("c"))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    return composition


async def plans(composition: Any, query: str = "") -> Any:
    answer = await composition(OPERATOR, "GET", f"{PATH}{query}")
    assert answer.status_code == 200, answer.text
    return answer.json()["plans"]


async def close_until(composition: Any, hours: int) -> None:
    until = (composition.clock.now() + timedelta(hours=hours)).isoformat()
    body = {"reason": "fog", "until": until}
    await composition(OPERATOR, "POST", "/v1/stations/b/closures", body)
    await composition.replanner.step()


async def test_each_plan_says_when_it_was_sent_and_which_steps_it_replaced(
    flying: Any, drone: Any
) -> None:
    booked_at = flying.clock.now()
    flying.clock.advance(timedelta(seconds=5))
    await close_until(flying, 2)
    revision = (await flying.sent())[-1]
    flying.clock.advance(timedelta(minutes=5))

    first, second = await plans(flying)

    assert (first["mission_revision"], second["mission_revision"]) == (1, 2)
    assert first["sent_at"] == booked_at.isoformat().replace("+00:00", "Z")
    assert second["sent_at"] > first["sent_at"]
    assert (first["is_accepted"], second["is_accepted"]) == (True, False)
    assert second["first_step"] == revision.first_step
    assert [each["kind"] for each in second["steps"]] == [each.kind for each in revision.steps]

    await flying.receive(drone.ack(revision))
    assert [each["is_accepted"] for each in await plans(flying)] == [True, True]


async def test_missions_outside_the_span_are_not_shown(flying: Any) -> None:
    flying.clock.advance(timedelta(hours=1))
    until = (flying.clock.now() - timedelta(hours=2)).isoformat().replace("+", "%2B")

    assert await plans(flying, f"?to={until}") == []
    assert len(await plans(flying)) == 1


@pytest.mark.parametrize(
    ("caller", "path", "status"),
    [
        ("provider:prv_1", PATH, 200),
        ("provider:prv_2", PATH, 404),
        (OPERATOR, "/v1/drones/drn_9/plans", 404),
        ("customer:c", PATH, 403),
        (OPERATOR, f"{PATH}?from=2026-01-01T00:00:00Z", 422),
        (OPERATOR, f"{PATH}?from=2026-03-02T00:00:00Z&to=2026-03-01T00:00:00Z", 422),
    ],
)
async def test_only_operators_and_the_drones_provider_see_the_plans_of_a_day(
    flying: Any, caller: str, path: str, status: int
) -> None:
    assert (await flying(caller, "GET", path)).status_code == status

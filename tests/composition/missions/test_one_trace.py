"""What composition says about a mission is in the trace in which it was booked."""

from typing import Any

from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.runtime.tracing import trace_id_of

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"
RECEIVED = f"00-{TRACE_ID}-00f067aa0ba902b7-01"


async def book(composition: Any, make: Any, *candidates: Any, delivery_id: str = "dlv_1") -> Any:
    """Book a mission in the trace of its delivery."""
    body = BookMissions(
        attempt=1,
        request=make.request("c"),
        shortlist=Shortlist.of(candidates or [make.candidate()]),
    )
    path = f"/internal/deliveries/{delivery_id}/missions"
    answer = await composition(
        "service:gateway", "PUT", path, body.model_dump(mode="json"), traceparent=RECEIVED
    )
    assert answer.json()["outcome"] == "BOOKED", answer.text
    return answer.json()["missions"][0]


async def spans(composition: Any) -> dict[str, set[str]]:
    """The spans of all messages that wait to be sent, by trace id."""
    rows = await composition.rows("SELECT traceparent FROM outbox")
    found: dict[str, set[str]] = {}
    for row in rows:
        found.setdefault(str(trace_id_of(row.traceparent)), set()).add(row.traceparent)
    return found


async def test_messages_of_drones_without_a_trace_are_handled_in_that_of_the_mission(
    composition: Any, drone: Any, make: Any
) -> None:
    await book(composition, make)
    (instruction,) = await composition.sent()

    await composition.receive(drone.ack(instruction))
    for received in drone.flown(instruction):
        composition.clock.advance(received.message.ended_at - composition.clock.now())
        await composition.receive(received)

    assert {report.kind for report in await composition.reports()} >= {"ACCEPTED", "ENDED"}
    found = await spans(composition)
    assert set(found) == {TRACE_ID}
    # Each time that something is done there is a span of its own.
    assert len(found[TRACE_ID]) > 3


async def test_what_operators_cause_is_in_the_trace_of_the_mission_too(
    composition: Any, drone: Any, make: Any
) -> None:
    mission = await book(composition, make)
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))

    hold = {"command": "HOLD", "reason": "a crowd below"}
    path = f"/v1/missions/{mission['mission_id']}/commands"
    await composition("operator:op", "POST", path, hold)
    await composition("operator:op", "POST", path, {"command": "RESUME", "reason": "they left"})
    cancelled = {"command": "CANCEL", "reason": "bad weather"}
    await composition("operator:op", "POST", path, cancelled)

    assert [each.kind for each in await composition.sent()] == ["HOLD", "RESUME", "CANCEL"]
    assert set(await spans(composition)) == {TRACE_ID}
    assert {trace_id_of(each.traceparent) for each in await composition.sent()} == {TRACE_ID}

"""Each check of the gateway's invariants finds the damage that breaks it."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.runtime.errors import RowRefused
from tests.gateway.whole_gateway import Gateway

COMPLETED = "SELECT delivery_id FROM deliveries WHERE state = 'COMPLETED'"

DAMAGES = [
    ("lost request", "UPDATE deliveries SET give_up_ms = 1 WHERE state = 'REQUESTED'", "I5"),
    (
        "scheduled and never requested",
        "UPDATE deliveries SET state = 'SCHEDULED', is_queued = FALSE WHERE state = 'REQUESTED'",
        "I5 a scheduled delivery is requested before its pickup",
    ),
    (
        "scheduled and queued",
        "UPDATE deliveries SET state = 'SCHEDULED' WHERE state = 'REQUESTED'",
        "I5 a delivery is queued while packages of it wait",
    ),
    (
        "waits after its end",
        "UPDATE deliveries SET waits_since_ms = 1 WHERE state = 'COMPLETED'",
        "I5 a request that waits for a drone is queued",
    ),
    (
        "in the wrong class",
        "UPDATE deliveries SET queue_rank = 0 WHERE state = 'REQUESTED'",
        "I5 requests wait in the order of their classes",
    ),
    (
        "finished again",
        "UPDATE deliveries SET state = 'PLANNED' WHERE state = 'COMPLETED'",
        "I5 a delivery that goes on has no final event",
    ),
    (
        "never said so",
        "UPDATE events SET type = 'delivery.delayed' WHERE type = 'delivery.completed'",
        "I5 a delivery that is over",
    ),
    (
        "mission lost",
        "UPDATE missions SET state = 'ABORTED'",
        "I5 a delivery under way has a mission under way, or packages that wait",
    ),
    (
        "fell out of the queue",
        "UPDATE deliveries SET is_queued = FALSE WHERE state = 'REQUESTED'",
        "I5 a delivery is queued while packages of it wait",
    ),
    (
        "queued for nothing",
        "UPDATE deliveries SET is_queued = TRUE WHERE state = 'COMPLETED'",
        "I5 a delivery is queued while packages of it wait",
    ),
    (
        "nobody flies it",
        "UPDATE deliveries SET is_queued = FALSE WHERE state = 'REQUESTED'",
        "I5 a request that nobody flies is queued",
    ),
    (
        "goes on without packages",
        "UPDATE packages SET state = 'STRANDED' WHERE state = 'CREATED'",
        "I5 a delivery is over when all its packages are",
    ),
    (
        "over with a package on its way",
        "UPDATE packages SET state = 'IN_TRANSIT' WHERE state = 'DELIVERED'",
        "I5 a delivery is over when all its packages are",
    ),
    (
        "on its way without a mission",
        "UPDATE packages SET state = 'LOADED', mission_id = NULL WHERE state = 'CREATED'",
        "I6 a package on its way has one mission",
    ),
    (
        "its mission is over",
        "UPDATE missions SET state = 'COMPLETED' WHERE state = 'BOOKED'",
        "I6 a package on its way has one mission",
    ),
    (
        "another delivery's mission",
        f"UPDATE packages SET mission_id = 'msn_of_nobody' WHERE delivery_id IN ({COMPLETED})",
        "I6 a package's mission is one of its delivery's",
    ),
    (
        "custody gap",
        f"DELETE FROM custody WHERE seq = 2 AND delivery_id IN ({COMPLETED})",
        "I6 a package's chain",
    ),
    (
        "wrong custodian",
        "UPDATE packages SET custodian_id = 'nobody' WHERE state = 'CREATED'",
        "I6 a package's custodian",
    ),
    (
        "delivered without a recipient",
        "UPDATE packages SET state = 'DELIVERED' WHERE state = 'CREATED'",
        "I6 a package is delivered once",
    ),
    (
        "forecast before the plan",
        "UPDATE packages SET promised_p90_ms = promised_ms - 1 WHERE state = 'CREATED'",
        "a package has a P90 only with a promise",
    ),
    (
        "due when nothing was promised",
        "UPDATE packages SET due_ms = promised_ms + 1 WHERE state = 'CREATED'",
        "a package is due at the moment that was promised",
    ),
    (
        "promise moved by two milliseconds",
        "UPDATE packages SET promised_ms = promised_ms + 2 WHERE state = 'CREATED'",
        "a package has the promise that its customer was notified of",
    ),
    (
        "changed in the future",
        "UPDATE deliveries SET updated_ms = updated_ms + 3600000",
        "what is stored as past is past, by fleet time",
    ),
    (
        "woken in the future",
        "UPDATE deliveries SET woken_wall_ms = updated_ms + 3600000",
        "what is stored as past is past, by wall time",
    ),
    (
        "event lost",
        f"UPDATE events SET sequence = 99 WHERE sequence = 2 AND delivery_id IN ({COMPLETED})",
        "a delivery's events have no gap",
    ),
    (
        "webhook not notified",
        "DELETE FROM notifications WHERE sequence = 1",
        "I14 each webhook is notified",
    ),
    (
        "out of sequence",
        "UPDATE notifications SET state = 'DELIVERED' WHERE sequence = 2",
        "I14 notifications of a delivery arrive in sequence",
    ),
]


@pytest.fixture
async def lived(gateway_on_both: Gateway) -> Any:
    """A gateway with a webhook, a completed, a planned and a queued delivery."""
    gateway = gateway_on_both
    body = {"url": "http://127.0.0.1:9/"}
    await gateway.http.post("/v1/webhooks", json=body, headers=gateway.customer)
    gateway.clock.advance(timedelta(seconds=1))
    delivery_id = await gateway.planned()
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])
    await gateway.planned()
    await gateway.accepted()
    assert await gateway.verified() == []
    return gateway


@pytest.mark.parametrize(
    ("damage", "rule"), [row[1:] for row in DAMAGES], ids=[row[0] for row in DAMAGES]
)
async def test_damage_is_found(lived: Any, damage: str, rule: str) -> None:
    lived.is_damaged = True
    await lived.execute(damage)
    assert any(found.startswith(rule) for found in await lived.verified())


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE events SET recorded_wall_ms = recorded_wall_ms + 1 WHERE sequence = 1",
        "UPDATE events SET body = body || ' ' WHERE sequence = 1",
        "UPDATE deliveries SET events_hash = ''",
    ],
)
async def test_an_event_that_was_changed_later_is_found(lived: Any, damage: str) -> None:
    lived.is_damaged = True
    await lived.execute(damage)

    found = await lived.verified()

    assert any("a delivery's events are those that were recorded" in each for each in found)


async def test_a_package_cannot_be_delivered_twice(lived: Any) -> None:
    """The database refuses a second delivery of a package."""
    with pytest.raises(RowRefused, match="custody_delivered"):
        await lived.execute(
            "INSERT INTO custody SELECT delivery_id, package_id, 9, custodian_kind, custodian_id, 0"
            " FROM custody WHERE custodian_kind = 'RECIPIENT'"
        )


async def test_two_events_cannot_have_the_same_sequence_number(lived: Any) -> None:
    with pytest.raises(RowRefused, match="event_sequence"):
        await lived.execute(
            "INSERT INTO events SELECT 'evt_x', delivery_id, sequence, type, body, 0 FROM events"
            " WHERE sequence = 1"
        )

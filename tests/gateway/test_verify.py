"""Damages that break the gateway's rules in other ways than those of tests/verification."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.runtime.errors import RowRefused
from tests.gateway.whole_gateway import Gateway

DAMAGES = [
    (
        "scheduled and queued",
        "UPDATE deliveries SET state = 'SCHEDULED' WHERE state = 'REQUESTED'",
        "I5 a delivery is queued while packages of it wait",
    ),
    (
        "never said so",
        "UPDATE events SET type = 'delivery.delayed' WHERE type = 'delivery.completed'",
        "I5 a delivery that is over",
    ),
    (
        "fell out of the queue",
        "UPDATE deliveries SET is_queued = FALSE WHERE state = 'REQUESTED'",
        "I5 a delivery is queued while packages of it wait",
    ),
    (
        "goes on without packages",
        "UPDATE packages SET state = 'STRANDED' WHERE state = 'CREATED'",
        "I5 a delivery is over when all its packages are",
    ),
    (
        "its mission is over",
        "UPDATE missions SET state = 'COMPLETED' WHERE state = 'BOOKED'",
        "I6 a package on its way has one mission",
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


@pytest.mark.databases("postgresql")
@pytest.mark.parametrize(
    ("damage", "rule"), [row[1:] for row in DAMAGES], ids=[row[0] for row in DAMAGES]
)
async def test_damage_is_found(lived: Any, damage: str, rule: str) -> None:
    lived.is_damaged = True
    await lived.execute(damage)
    assert any(found.startswith(rule) for found in await lived.verified())


@pytest.mark.databases("postgresql")
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

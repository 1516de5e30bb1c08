"""Old audit entries and webhook attempts are deleted, and verification finds no fault."""

from datetime import timedelta

import pytest
from skyway_gateway.access.session_store import SESSION_LASTS
from skyway_gateway.retention.pruning import ExpiredPruning, LogPruning

from skyway.units import moment_to_ms
from tests.gateway.whole_gateway import Gateway

DAY = timedelta(days=1)


def pruning(gateway: Gateway) -> LogPruning:
    return LogPruning(gateway.parts.db, gateway.clock, audit_kept=DAY, attempts_kept=DAY)


async def calls(gateway: Gateway, count: int) -> None:
    """Calls of an operator, each with an entry in the audit log."""
    for number in range(count):
        body = {"role": "customer", "subject_id": f"c{number}"}
        answer = await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)
        assert answer.is_success, answer.text


async def numbers(gateway: Gateway) -> list[int]:
    """The numbers of the audit entries."""
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql("SELECT number FROM audit ORDER BY number")
        return list(found.scalars())


async def test_old_audit_entries_are_deleted_and_the_chain_holds(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    await calls(gateway, 3)
    gateway.clock.advance(2 * DAY)
    await calls(gateway, 2)

    await pruning(gateway).step()
    assert await numbers(gateway) == [4, 5]
    await calls(gateway, 1)

    assert await numbers(gateway) == [4, 5, 6]
    assert await gateway.broken() == []


async def test_all_audit_entries_may_be_deleted(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await calls(gateway, 2)
    gateway.clock.advance(2 * DAY)

    await pruning(gateway).step()
    assert await gateway.broken() == []
    await calls(gateway, 1)

    assert await numbers(gateway) == [3]


@pytest.mark.parametrize(
    "damage",
    [
        "DELETE FROM audit WHERE number = 4",
        "UPDATE audit_head SET pruned_hash = 'other'",
        "UPDATE audit_head SET pruned_entries = 2",
    ],
)
async def test_an_entry_that_somebody_deleted_is_found_after_pruning(
    gateway_on_both: Gateway, damage: str
) -> None:
    gateway = gateway_on_both
    await calls(gateway, 3)
    gateway.clock.advance(2 * DAY)
    await calls(gateway, 2)
    await pruning(gateway).step()
    gateway.is_damaged = True

    await gateway.execute(damage)

    assert "the audit log has every entry as it was written" in await gateway.verified()


async def attempted(gateway: Gateway) -> None:
    """A delivery whose events were delivered to a webhook at the first attempt."""
    await gateway.accepted()
    await gateway.execute(
        "UPDATE notifications SET state = 'DELIVERED', attempts = 1 WHERE attempts = 0"
    )
    await gateway.execute(
        "INSERT INTO webhook_attempts (attempt_id, webhook_id, event_id, event_type, delivery_id,"
        " number, at_wall_ms, duration_ms, outcome) SELECT 'att_' || n.event_id, n.webhook_id,"
        " n.event_id, 'any', n.delivery_id, 1, e.recorded_wall_ms, 5, 'DELIVERED'"
        " FROM notifications n JOIN events e ON e.event_id = n.event_id"
        " WHERE 'att_' || n.event_id NOT IN (SELECT attempt_id FROM webhook_attempts)"
    )


async def attempts(gateway: Gateway) -> int:
    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql("SELECT count(*) FROM webhook_attempts")
        return int(found.scalar_one())


async def test_old_attempts_are_deleted_and_not_missed(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    body = {"url": "http://127.0.0.1:9/"}
    await gateway.http.post("/v1/webhooks", json=body, headers=gateway.customer)
    gateway.clock.advance(timedelta(seconds=1))
    await attempted(gateway)
    gateway.clock.advance(2 * DAY)
    await attempted(gateway)
    before = await attempts(gateway)
    gateway.is_damaged = True  # the first request has waited for two days

    await pruning(gateway).step()

    assert 0 < await attempts(gateway) < before
    missing = "I14 a notification that was delivered or tried has its attempt"
    assert missing not in await gateway.verified()
    await gateway.execute("DELETE FROM webhook_attempts")
    assert missing in await gateway.verified()


async def test_nothing_is_deleted_without_a_setting(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    await calls(gateway, 3)
    gateway.clock.advance(400 * DAY)

    await LogPruning(gateway.parts.db, gateway.clock, None, None).step()

    assert await numbers(gateway) == [1, 2, 3]


async def test_only_sessions_that_have_expired_are_deleted(gateway: Gateway) -> None:
    async def opened() -> None:
        answer = await gateway.http.post("/v1/sessions", headers=gateway.customer)
        assert answer.status_code == 201, answer.text
        gateway.http.cookies.clear()

    await opened()
    gateway.clock.advance(SESSION_LASTS + timedelta(seconds=1))
    await opened()

    await ExpiredPruning(gateway.parts.db, gateway.clock).step()

    async with gateway.parts.db.read() as connection:
        found = await connection.exec_driver_sql("SELECT expires_wall_ms FROM sessions")
        [expires_wall_ms] = found.scalars()
    assert expires_wall_ms > moment_to_ms(gateway.clock.wall_now())

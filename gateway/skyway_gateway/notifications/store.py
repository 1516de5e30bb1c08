"""All SQL of events, webhooks and notifications, but for how new events are kept (`telling`)."""

import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any, Final

from sqlalchemy import (
    Column,
    ColumnElement,
    Row,
    and_,
    delete,
    exists,
    false,
    insert,
    select,
    true,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId, EventId, SubjectId, WebhookId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.claims import FREE, claim
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.notifications.webhook import (
    Endpoint,
    Notification,
    Webhook,
    WebhookAttempt,
)
from skyway_gateway.tables import (
    events,
    notifications,
    webhook_attempts,
    webhooks,
)

#: Longer than a try may take, seconds of wall time.
_LEASE_S: Final = 20.0


async def events_after(
    connection: AsyncConnection, delivery_id: DeliveryId, *, after: int
) -> Sequence[Row[*tuple[Any, ...]]]:  # columns of every type
    """The events after a sequence: sequence, type, body."""
    statement = (
        select(events.c.sequence, events.c.type, events.c.body)
        .where(events.c.delivery_id == delivery_id, events.c.sequence > after)
        .order_by(events.c.sequence)
    )
    return (await connection.execute(statement)).all()


async def last_event(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> Row[*tuple[Any, ...]] | None:  # columns of every type
    """The newest event: sequence, type."""
    statement = (
        select(events.c.sequence, events.c.type)
        .where(events.c.delivery_id == delivery_id)
        .order_by(events.c.sequence.desc())
        .limit(1)
    )
    return (await connection.execute(statement)).first()


def owned(caller: Caller, customer_id: Column[str]) -> ColumnElement[bool]:
    """Whether what belongs to a customer is the caller's: operators see everybody's."""
    if caller.role == "operator":
        return true()
    return customer_id == caller.subject_id if caller.role == "customer" else false()


async def add_webhook(tx: Tx, webhook: Webhook, *, customer_id: SubjectId, secret: str) -> None:
    """Keep a new webhook."""
    at_ms = moment_to_ms(webhook.created_at)
    row = {
        "webhook_id": webhook.webhook_id,
        "customer_id": customer_id,
        "url": webhook.url,
        "event_types": _types_text(webhook.event_types),
        "secret": secret,
        "state": webhook.state,
        "disabled_reason": webhook.disabled_reason,
        "created_wall_ms": at_ms,
        "changed_wall_ms": at_ms,
    }
    await tx.execute(insert(webhooks).values(row))


async def webhook_of(connection: AsyncConnection, caller: Caller, webhook_id: WebhookId) -> Webhook:
    """The caller's own webhook.

    Raises
    ------
    NotFound
        There is no such webhook, or it is not the caller's.
    """
    return _webhook(await _webhook_row(connection, caller, webhook_id))


async def endpoint_of(
    connection: AsyncConnection, caller: Caller, webhook_id: WebhookId
) -> Endpoint:
    """Where and how the caller's own webhook is notified.

    Raises
    ------
    NotFound
        There is no such webhook, or it is not the caller's.
    """
    return _endpoint(await _webhook_row(connection, caller, webhook_id))


async def webhooks_page(
    connection: AsyncConnection, caller: Caller, query: PageQuery
) -> Sequence[Webhook]:
    """Up to limit + 1 of the caller's webhooks, sorted by id."""
    statement = select(webhooks).where(owned(caller, webhooks.c.customer_id))
    if (after := query.after(str)) is not None:
        statement = statement.where(webhooks.c.webhook_id > after[0])
    statement = statement.order_by(webhooks.c.webhook_id).limit(query.limit + 1)
    return [_webhook(row) for row in await connection.execute(statement)]


async def change_webhook(tx: Tx, webhook: Webhook, *, at: datetime) -> None:
    """Keep a webhook's new url, event types and state."""
    values = {
        "url": webhook.url,
        "event_types": _types_text(webhook.event_types),
        "state": webhook.state,
        "disabled_reason": webhook.disabled_reason,
        "changed_wall_ms": moment_to_ms(at),
    }
    this = webhooks.c.webhook_id == webhook.webhook_id
    await tx.execute(update(webhooks).where(this).values(values))
    if webhook.state == "DISABLED":
        await give_up_pending(tx, webhook.webhook_id)


async def delete_webhook(tx: Tx, webhook_id: WebhookId) -> None:
    """Forget a webhook, with all that was or is to be told to it."""
    for table in (webhook_attempts, notifications, webhooks):
        await tx.execute(delete(table).where(table.c.webhook_id == webhook_id))


async def disable_webhook(tx: Tx, webhook_id: WebhookId, *, reason: str, at: datetime) -> None:
    """Notify this webhook no more, until its customer makes it active again."""
    values = {
        "state": "DISABLED",
        "disabled_reason": reason,
        "changed_wall_ms": moment_to_ms(at),
    }
    await tx.execute(update(webhooks).where(webhooks.c.webhook_id == webhook_id).values(values))
    await give_up_pending(tx, webhook_id)


async def give_up_pending(tx: Tx, webhook_id: WebhookId) -> None:
    """Try none of a webhook's pending notifications again."""
    pending = and_(notifications.c.webhook_id == webhook_id, notifications.c.state == "PENDING")
    await tx.execute(update(notifications).where(pending).values(state="GIVEN_UP", **FREE))


async def due_endpoints(connection: AsyncConnection, *, at: datetime) -> Sequence[Endpoint]:
    """The webhooks that have something to be told now."""
    is_due = exists().where(
        notifications.c.webhook_id == webhooks.c.webhook_id,
        _is_due(at),
        notifications.c.claimed_until_ms <= moment_to_ms(at),
    )
    statement = select(webhooks).where(webhooks.c.state == "ACTIVE", is_due)
    return [_endpoint(row) for row in await connection.execute(statement)]


async def claim_due(
    db: Database,
    webhook_id: WebhookId,
    *,
    limit: int,
    claimant: str,
    clock: FleetClock,
) -> Sequence[Notification]:
    """Notifications that are due at a webhook, each of another delivery, now held by us."""
    rows = await claim(
        db,
        notifications,
        where=and_(notifications.c.webhook_id == webhook_id, _is_due(clock.wall_now())),
        order_by=[notifications.c.next_try_wall_ms, notifications.c.event_id],
        limit=limit,
        claimant=claimant,
        lease_s=_LEASE_S,
        clock=clock,
    )
    if not rows:
        return []
    by_id = select(events).where(events.c.event_id.in_([row.event_id for row in rows]))
    async with db.read() as connection:
        told = {event.event_id: event for event in await connection.execute(by_id)}
    return [_notification(row, told[row.event_id]) for row in rows]


async def free_claims(tx: Tx) -> None:
    """Let go of all that somebody held: on SQLite whoever claimed before us is dead."""
    await tx.execute(update(notifications).where(notifications.c.state == "PENDING").values(FREE))


async def settle(
    tx: Tx,
    webhook_id: WebhookId,
    event_id: EventId,
    *,
    attempt: WebhookAttempt,
) -> bool:
    """Note how a try went; False when the notification is no more."""
    state = {"DELIVERED": "DELIVERED", "FAILED": "PENDING", "GIVEN_UP": "GIVEN_UP"}
    values = {
        "state": state[attempt.outcome],
        "attempts": attempt.number,
        "next_try_wall_ms": moment_to_ms(attempt.next_try_at or attempt.at),
        **FREE,
    }
    this = and_(
        notifications.c.webhook_id == webhook_id,
        notifications.c.event_id == event_id,
        notifications.c.state == "PENDING",
    )
    found = await tx.execute(update(notifications).where(this).values(values))
    return found.rowcount == 1


async def add_attempt(tx: Tx, webhook_id: WebhookId, attempt: WebhookAttempt) -> None:
    """Keep how a try went, for the customer to see."""
    row = {
        **attempt.model_dump(exclude={"at", "next_try_at"}),
        "webhook_id": webhook_id,
        "at_wall_ms": moment_to_ms(attempt.at),
        "next_try_wall_ms": attempt.next_try_at and moment_to_ms(attempt.next_try_at),
    }
    await tx.execute(insert(webhook_attempts).values(row))


async def attempts_page(
    connection: AsyncConnection, webhook_id: WebhookId, query: PageQuery
) -> Sequence[WebhookAttempt]:
    """Up to limit + 1 tries of a webhook, the newest first."""
    statement = select(webhook_attempts).where(webhook_attempts.c.webhook_id == webhook_id)
    if (after := query.after(str)) is not None:
        statement = statement.where(webhook_attempts.c.attempt_id < after[0])
    statement = statement.order_by(webhook_attempts.c.attempt_id.desc()).limit(query.limit + 1)
    return [_attempt(row) for row in await connection.execute(statement)]


def _is_due(at: datetime) -> ColumnElement[bool]:
    """Whether it is time, and no earlier event of the delivery is still to be told there."""
    earlier = notifications.alias("earlier")
    has_earlier = exists().where(
        earlier.c.webhook_id == notifications.c.webhook_id,
        earlier.c.delivery_id == notifications.c.delivery_id,
        earlier.c.sequence < notifications.c.sequence,
        earlier.c.state == "PENDING",
    )
    return and_(
        notifications.c.state == "PENDING",
        notifications.c.next_try_wall_ms <= moment_to_ms(at),
        ~has_earlier,
    )


async def _webhook_row(
    connection: AsyncConnection, caller: Caller, webhook_id: WebhookId
) -> Row[*tuple[Any, ...]]:  # columns of every type
    statement = select(webhooks).where(
        webhooks.c.webhook_id == webhook_id, owned(caller, webhooks.c.customer_id)
    )
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("webhook", webhook_id)
    return row


def _types_text(types: tuple[DeliveryEventType, ...] | None) -> str | None:
    return None if types is None else json.dumps(list(types))


def _webhook(row: Row[*tuple[Any, ...]]) -> Webhook:  # columns of every type
    return Webhook(
        webhook_id=row.webhook_id,
        url=row.url,
        event_types=None if row.event_types is None else tuple(json.loads(row.event_types)),
        state=row.state,
        disabled_reason=row.disabled_reason,
        created_at=ms_to_moment(row.created_wall_ms),
    )


def _endpoint(row: Row[*tuple[Any, ...]]) -> Endpoint:  # columns of every type
    return Endpoint(row.webhook_id, row.url, row.secret)


def _notification(row: Row[*tuple[Any, ...]], event: Row[*tuple[Any, ...]]) -> Notification:
    """Any: columns of every type."""
    return Notification(
        event_id=row.event_id,
        event_type=event.type,
        delivery_id=row.delivery_id,
        attempts=row.attempts,
        body=event.body.encode(),
    )


def _attempt(row: Row[*tuple[Any, ...]]) -> WebhookAttempt:  # columns of every type
    next_try_ms = row.next_try_wall_ms
    return WebhookAttempt(
        attempt_id=row.attempt_id,
        event_id=row.event_id,
        event_type=row.event_type,
        delivery_id=row.delivery_id,
        number=row.number,
        at=ms_to_moment(row.at_wall_ms),
        duration_ms=row.duration_ms,
        outcome=row.outcome,
        status=row.status,
        detail=row.detail,
        next_try_at=None if next_try_ms is None else ms_to_moment(next_try_ms),
    )

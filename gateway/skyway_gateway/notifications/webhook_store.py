"""The SQL of customers' webhooks, of the notifications that are due there, and of each attempt."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from sqlalchemy import ColumnElement, and_, delete, exists, func, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import EventId, SubjectId, WebhookId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.claims import FREE, claim, is_free
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import owned
from skyway_gateway.access.usage import UsageQuota
from skyway_gateway.notifications.secret_store import StoredSecrets
from skyway_gateway.notifications.webhook import (
    Endpoint,
    Notification,
    Webhook,
    WebhookAttempt,
    WebhookEventType,
)
from skyway_gateway.tables import events, notifications, webhook_attempts, webhooks

#: How long a claim holds: longer than an attempt may take, seconds of wall time.
_LEASE_S: Final = 20.0

#: How the newest attempt went: ids of attempts rise with time.
_LAST_OUTCOME: Final = (
    select(webhook_attempts.c.outcome)
    .where(webhook_attempts.c.webhook_id == webhooks.c.webhook_id)
    .order_by(webhook_attempts.c.attempt_id.desc())
    .limit(1)
    .correlate(webhooks)
    .scalar_subquery()
    .label("last_outcome")
)


async def add_webhook(
    tx: Tx, webhook: Webhook, *, customer_id: SubjectId, stored_secret: str
) -> None:
    """Add a webhook with its encrypted secret."""
    at_ms = moment_to_ms(webhook.created_wall_at)
    row = {
        "webhook_id": webhook.webhook_id,
        "customer_id": customer_id,
        "url": webhook.url,
        "event_types": _types_text(webhook.event_types),
        "secret": stored_secret,
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
    connection: AsyncConnection, caller: Caller, webhook_id: WebhookId, *, at: datetime
) -> Endpoint:
    """The URL and secrets of the caller's own webhook.

    Raises
    ------
    NotFound
        There is no such webhook, or it is not the caller's.
    """
    row = await _webhook_row(connection, caller, webhook_id)
    return _endpoint(row, at)


async def webhooks_page(
    connection: AsyncConnection, caller: Caller, query: PageQuery
) -> Sequence[Webhook]:
    """Up to limit + 1 of the caller's webhooks, sorted by id."""
    statement = select(webhooks, _LAST_OUTCOME).where(owned(caller, webhooks.c.customer_id))
    if (after := query.after_id()) is not None:
        statement = statement.where(webhooks.c.webhook_id > after)
    statement = statement.order_by(webhooks.c.webhook_id).limit(query.limit + 1)
    return [_webhook(row) for row in await connection.execute(statement)]


async def change_webhook(tx: Tx, webhook: Webhook, *, at: datetime) -> None:
    """Write a webhook's new URL, event types and state."""
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
        await _give_up_pending(tx, webhook.webhook_id)


async def delete_webhook(tx: Tx, webhook_id: WebhookId) -> None:
    """Delete a webhook with its notifications and attempts."""
    for table in (webhook_attempts, notifications, webhooks):
        await tx.execute(delete(table).where(table.c.webhook_id == webhook_id))


async def disable_webhook(tx: Tx, webhook_id: WebhookId, *, reason: str, at: datetime) -> None:
    """Stop notifying a webhook until its customer makes it active again."""
    values = {
        "state": "DISABLED",
        "disabled_reason": reason,
        "changed_wall_ms": moment_to_ms(at),
    }
    await tx.execute(update(webhooks).where(webhooks.c.webhook_id == webhook_id).values(values))
    await _give_up_pending(tx, webhook_id)


async def due_endpoints(connection: AsyncConnection, *, at: datetime) -> Sequence[Endpoint]:
    """The webhooks with a notification that is due now."""
    is_due = exists().where(
        notifications.c.webhook_id == webhooks.c.webhook_id,
        _is_due(at),
        is_free(notifications),
    )
    statement = select(webhooks).where(webhooks.c.state == "ACTIVE", is_due)
    return [
        _endpoint(row, at)
        for row in await connection.execute(statement, {"now_ms": moment_to_ms(at)})
    ]


def _endpoint(row: AnyRow, at: datetime) -> Endpoint:
    stored = StoredSecrets.of(row)
    in_use = (stored.present, *(each.secret for each in stored.still_valid(at)))
    return Endpoint(row.webhook_id, row.customer_id, row.url, in_use)


async def claim_due(
    db: Database,
    webhook_id: WebhookId,
    *,
    limit: int,
    claimant: str,
    clock: FleetClock,
) -> Sequence[Notification]:
    """Claim notifications that are due at a webhook, each of another delivery."""
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
    statement = select(events).where(events.c.event_id.in_([row.event_id for row in rows]))
    async with db.read() as connection:
        by_event_id = {event.event_id: event for event in await connection.execute(statement)}
    return [_notification(row, by_event_id[row.event_id]) for row in rows]


async def free_claims(tx: Tx) -> None:
    """Free all claims. Only for SQLite, where all earlier claimants are dead at the start."""
    await tx.execute(update(notifications).where(notifications.c.state == "PENDING").values(FREE))


async def settle(
    tx: Tx,
    webhook_id: WebhookId,
    event_id: EventId,
    *,
    attempt: WebhookAttempt,
) -> bool:
    """Write how an attempt went; False when the notification is no longer pending."""
    state = {"DELIVERED": "DELIVERED", "FAILED": "PENDING", "GIVEN_UP": "GIVEN_UP"}
    values = {
        "state": state[attempt.outcome],
        "attempts": attempt.number,
        "next_try_wall_ms": moment_to_ms(attempt.next_try_wall_at or attempt.wall_at),
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
    """Add an attempt, for the customer to see."""
    row = {
        **attempt.model_dump(exclude={"wall_at", "next_try_wall_at"}),
        "webhook_id": webhook_id,
        "at_wall_ms": moment_to_ms(attempt.wall_at),
        "next_try_wall_ms": attempt.next_try_wall_at and moment_to_ms(attempt.next_try_wall_at),
    }
    await tx.execute(insert(webhook_attempts).values(row))


async def attempts_page(
    connection: AsyncConnection, webhook_id: WebhookId, query: PageQuery
) -> Sequence[WebhookAttempt]:
    """Up to limit + 1 attempts of a webhook, the newest first."""
    statement = select(webhook_attempts).where(webhook_attempts.c.webhook_id == webhook_id)
    if (after := query.after_id()) is not None:
        statement = statement.where(webhook_attempts.c.attempt_id < after)
    statement = statement.order_by(webhook_attempts.c.attempt_id.desc()).limit(query.limit + 1)
    return [_attempt(row) for row in await connection.execute(statement)]


async def _give_up_pending(tx: Tx, webhook_id: WebhookId) -> None:
    """Give up all pending notifications of a webhook."""
    pending = and_(notifications.c.webhook_id == webhook_id, notifications.c.state == "PENDING")
    await tx.execute(update(notifications).where(pending).values(state="GIVEN_UP", **FREE))


async def _webhook_row(
    connection: AsyncConnection, caller: Caller, webhook_id: WebhookId
) -> AnyRow:
    statement = select(webhooks, _LAST_OUTCOME).where(
        webhooks.c.webhook_id == webhook_id, owned(caller, webhooks.c.customer_id)
    )
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("webhook", webhook_id)
    return row


def _types_text(types: tuple[WebhookEventType, ...] | None) -> str | None:
    return None if types is None else json.dumps(list(types))


def _webhook(row: AnyRow) -> Webhook:
    return Webhook(
        webhook_id=row.webhook_id,
        url=row.url,
        event_types=None if row.event_types is None else tuple(json.loads(row.event_types)),
        state=row.state,
        disabled_reason=row.disabled_reason,
        created_wall_at=ms_to_moment(row.created_wall_ms),
        last_outcome=row.last_outcome,
    )


def _is_due(at: datetime) -> ColumnElement[bool]:
    """Whether a notification is due and no earlier event of its delivery is pending there."""
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


def _notification(row: AnyRow, event: AnyRow) -> Notification:
    """The notification in its own row and its event's row."""
    return Notification(
        event_id=row.event_id,
        event_type=event.type,
        delivery_id=row.delivery_id,
        attempts=row.attempts,
        body=event.body.encode(),
    )


def _attempt(row: AnyRow) -> WebhookAttempt:
    next_try_ms = row.next_try_wall_ms
    return WebhookAttempt(
        attempt_id=row.attempt_id,
        event_id=row.event_id,
        event_type=row.event_type,
        delivery_id=row.delivery_id,
        number=row.number,
        wall_at=ms_to_moment(row.at_wall_ms),
        duration_ms=row.duration_ms,
        outcome=row.outcome,
        status=row.status,
        detail=row.detail,
        next_try_wall_at=None if next_try_ms is None else ms_to_moment(next_try_ms),
    )


@dataclass(frozen=True, slots=True)
class WebhookQuota:
    """Refuses webhooks beyond the limit of their customer."""

    db: Database
    most: int

    async def refuse_too_many(self, tx: Tx, customer_id: SubjectId) -> None:
        """Go on only if the customer may have one more.

        Raises
        ------
        Conflict
            TOO_MANY_WEBHOOKS.
        """
        if await _used(tx.connection, customer_id) >= self.most:
            raise Conflict(
                "TOO_MANY_WEBHOOKS", f"the limit is {self.most} webhooks: delete one first"
            )

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """How many webhooks the caller has."""
        if caller.role != "customer":
            return ()
        async with self.db.read() as connection:
            used = await _used(connection, SubjectId(caller.subject_id))
        return (UsageQuota(code="TOO_MANY_WEBHOOKS", most=self.most, used=used),)


async def _used(connection: AsyncConnection, customer_id: SubjectId) -> int:
    statement = select(func.count()).where(webhooks.c.customer_id == customer_id)
    return int((await connection.execute(statement)).scalar_one())

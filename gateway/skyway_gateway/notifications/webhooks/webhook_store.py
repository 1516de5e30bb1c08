"""The SQL of customers' webhooks: URL, event types and state."""

import json
from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import and_, delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import SubjectId, WebhookId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import owned
from skyway_gateway.notifications.webhooks.webhook import Endpoint, Webhook
from skyway_gateway.tables import notifications, webhook_attempts, webhooks


async def add_webhook(tx: Tx, webhook: Webhook, *, customer_id: SubjectId, secret: str) -> None:
    """Add a webhook."""
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
    """The URL and secret of the caller's own webhook.

    Raises
    ------
    NotFound
        There is no such webhook, or it is not the caller's.
    """
    row = await _webhook_row(connection, caller, webhook_id)
    return Endpoint(row.webhook_id, row.url, row.secret)


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


async def _give_up_pending(tx: Tx, webhook_id: WebhookId) -> None:
    """Give up all pending notifications of a webhook."""
    pending = and_(notifications.c.webhook_id == webhook_id, notifications.c.state == "PENDING")
    await tx.execute(update(notifications).where(pending).values(state="GIVEN_UP", **FREE))


async def _webhook_row(
    connection: AsyncConnection, caller: Caller, webhook_id: WebhookId
) -> AnyRow:
    statement = select(webhooks).where(
        webhooks.c.webhook_id == webhook_id, owned(caller, webhooks.c.customer_id)
    )
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("webhook", webhook_id)
    return row


def _types_text(types: tuple[DeliveryEventType, ...] | None) -> str | None:
    return None if types is None else json.dumps(list(types))


def _webhook(row: AnyRow) -> Webhook:
    return Webhook(
        webhook_id=row.webhook_id,
        url=row.url,
        event_types=None if row.event_types is None else tuple(json.loads(row.event_types)),
        state=row.state,
        disabled_reason=row.disabled_reason,
        created_at=ms_to_moment(row.created_wall_ms),
    )

"""Replays: past events become due again at one webhook, and the sender sends them like new ones."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Final, Self

from pydantic import Field, model_validator
from sqlalchemy import ColumnElement, Select, func, literal, select, true
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.message import WallMoment
from skyway.errors import InvalidInput
from skyway.ids import DeliveryId, EventId, SubjectId, WebhookId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.notifications import webhook_store
from skyway_gateway.notifications.webhook import WebhookEventType
from skyway_gateway.tables import events, notifications

#: The most events that a call may name by id, and the most that it queues.
_MOST_NAMED: Final = 100
_MOST_EVENTS: Final = 10_000


class ReplayRequest(JsonModel):
    """The named events, all events of a delivery, or all that were recorded in [from, to).

    For a delivery or a span, only event types that the webhook subscribes to are sent.
    """

    event_ids: Annotated[
        Annotated[tuple[EventId, ...], Field(min_length=1, max_length=_MOST_NAMED)] | None,
        Field(description="The events to send again, 1 to 100."),
    ] = None
    delivery_id: Annotated[DeliveryId | None, Field(description="All events of this delivery.")] = (
        None
    )
    from_wall_at: Annotated[
        WallMoment | None,
        Field(description="All events recorded at this moment or later, wall time."),
    ] = None
    to_wall_at: Annotated[
        WallMoment | None,
        Field(
            description="With `from_wall_at`: only events recorded before this moment, wall time.",
        ),
    ] = None

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        given = [
            self.event_ids is not None,
            self.delivery_id is not None,
            self.from_wall_at is not None,
        ]
        if sum(given) != 1:
            raise ValueError("give one of event_ids, delivery_id and from_wall_at")
        if self.to_wall_at is not None and (
            self.from_wall_at is None or self.to_wall_at <= self.from_wall_at
        ):
            raise ValueError("to_wall_at must come with from_wall_at, and after it")
        return self


class Replay(JsonModel):
    """How many events were queued again; events that were still pending are not counted."""

    queued: Annotated[int, Field(ge=0, description="How many events were queued again.")]


async def replay(
    db: Database,
    caller: Caller,
    webhook_id: WebhookId,
    requested: ReplayRequest,
    *,
    clock: FleetClock,
    wake: Wake,
) -> Replay:
    """Queue events again for the caller's own webhook.

    Raises
    ------
    NotFound
        The webhook, the delivery or one of the events is not the caller's.
    Conflict
        WEBHOOK_DISABLED: nothing is sent to a disabled webhook.
    InvalidInput
        The span holds more events than one call may queue.
    """
    customer_id = SubjectId(caller.subject_id)
    async with db.write() as tx:
        webhook = await webhook_store.webhook_of(tx.connection, caller, webhook_id)
        if webhook.state != "ACTIVE":
            raise Conflict("WEBHOOK_DISABLED", f"webhook {webhook_id} is disabled")
        await _refuse_foreign(tx, requested, customer_id)
        which = _requested_events(
            requested, customer_id=customer_id, event_types=webhook.event_types
        )
        if await _count_requested(tx.connection, which, at_most=_MOST_EVENTS) > _MOST_EVENTS:
            detail = f"more than {_MOST_EVENTS} events in one call: shorten the span"
            raise InvalidInput("from_wall_at", detail)
        queued = await _queue_again(tx, webhook_id, which, at=clock.wall_now())
        tx.after_commit(wake.set)
    count("skyway_webhook_replays", "notifications queued again", float(queued))
    return Replay(queued=queued)


async def _refuse_foreign(tx: Tx, requested: ReplayRequest, customer_id: SubjectId) -> None:
    """Answer 404 for events and deliveries of other customers."""
    if requested.event_ids is not None:
        own = await _own_events(tx.connection, requested.event_ids, customer_id=customer_id)
        for event_id in requested.event_ids:
            if event_id not in own:
                raise NotFound("event", event_id)
    if requested.delivery_id is not None and not await _has_delivery(
        tx.connection, requested.delivery_id, customer_id=customer_id
    ):
        raise NotFound("delivery", requested.delivery_id)


async def _own_events(
    connection: AsyncConnection, event_ids: Sequence[EventId], *, customer_id: SubjectId
) -> frozenset[EventId]:
    """The events among these that belong to a customer."""
    statement = (
        select(events.c.event_id)
        .join(deliveries, deliveries.c.delivery_id == events.c.delivery_id)
        .where(events.c.event_id.in_(event_ids), deliveries.c.customer_id == customer_id)
    )
    return frozenset((await connection.execute(statement)).scalars())


async def _has_delivery(
    connection: AsyncConnection, delivery_id: DeliveryId, *, customer_id: SubjectId
) -> bool:
    """Whether a delivery belongs to a customer."""
    statement = select(deliveries.c.delivery_id).where(
        deliveries.c.delivery_id == delivery_id, deliveries.c.customer_id == customer_id
    )
    return (await connection.execute(statement)).first() is not None


async def _count_requested(
    connection: AsyncConnection, requested: ColumnElement[bool], *, at_most: int
) -> int:
    """How many events are requested; the count stops at one more than the limit."""
    found = _with_customer(select(literal(1))).where(requested).limit(at_most + 1).subquery()
    statement = select(func.count()).select_from(found)
    return int((await connection.execute(statement)).scalar_one())


def _requested_events(
    requested: ReplayRequest,
    *,
    customer_id: SubjectId,
    event_types: Sequence[WebhookEventType] | None,
) -> ColumnElement[bool]:
    """Whether an event belongs to the customer and is requested."""
    owned = deliveries.c.customer_id == customer_id
    if requested.event_ids is not None:
        return owned & events.c.event_id.in_(requested.event_ids)
    is_subscribed = true() if event_types is None else events.c.type.in_(event_types)
    if requested.delivery_id is not None:
        return owned & is_subscribed & (events.c.delivery_id == requested.delivery_id)
    recorded = events.c.recorded_wall_ms
    is_in_span = (
        true()
        if requested.from_wall_at is None
        else recorded >= moment_to_ms(requested.from_wall_at)
    )
    if requested.to_wall_at is not None:
        is_in_span &= recorded < moment_to_ms(requested.to_wall_at)
    return owned & is_subscribed & is_in_span


async def _queue_again(
    tx: Tx, webhook_id: WebhookId, requested: ColumnElement[bool], *, at: datetime
) -> int:
    """Make the requested events due at a webhook with a new first attempt; how many.

    An event that is still pending there stays as it is.
    """
    due = {
        "state": "PENDING",
        "attempts": 0,
        "next_try_wall_ms": moment_to_ms(at),
        "is_replay": True,
        **FREE,
    }
    columns = ["webhook_id", "event_id", "delivery_id", "sequence", *due]
    chosen = _with_customer(
        select(
            literal(webhook_id),
            events.c.event_id,
            events.c.delivery_id,
            events.c.sequence,
            *(literal(value, notifications.c[name].type) for name, value in due.items()),
        )
    ).where(requested)
    statement = tx.insert(notifications).from_select(columns, chosen)
    again = statement.on_conflict_do_update(
        index_elements=[notifications.c.webhook_id, notifications.c.event_id],
        set_=due,
        where=notifications.c.state != "PENDING",
    )
    return (await tx.execute(again)).rowcount


def _with_customer(
    selected: Select[*tuple[Any, ...]],  # columns of every type
) -> Select[*tuple[Any, ...]]:
    return selected.select_from(events).join(
        deliveries, deliveries.c.delivery_id == events.c.delivery_id
    )

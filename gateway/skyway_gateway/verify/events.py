"""The rules of delivery events: what a customer was notified of never changes."""

import json
from typing import Any, Final

from sqlalchemy import ColumnElement, func, or_, select

from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.survey import Survey
from skyway_gateway.notifications.event_store import hash_after
from skyway_gateway.tables import deliveries, events

_is_own = events.c.delivery_id == deliveries.c.delivery_id

_RESTORE: Final = (
    "Events are what the customer was notified of. Restore the rows of `events` from a backup; the "
    "customer's webhook has received the same bodies."
)


def _event_count(*conditions: ColumnElement[bool]) -> ColumnElement[int]:
    return select(func.count()).where(_is_own, *conditions).correlate(deliveries).scalar_subquery()


async def _changed(survey: Survey) -> list[str]:
    """The deliveries whose events do not lead to the stored hash."""
    hashes: dict[str, str] = {}
    async for row in survey.each(select(events).order_by(events.c.delivery_id, events.c.sequence)):
        before = hashes.get(row.delivery_id, "")
        hashes[row.delivery_id] = hash_after(
            before, body=row.body, recorded_wall_ms=row.recorded_wall_ms
        )
    query = select(deliveries.c.delivery_id, deliveries.c.events_hash)
    return [
        row.delivery_id
        async for row in survey.each(query)
        if hashes.get(row.delivery_id, "") != row.events_hash
    ]


async def _other_than_body(survey: Survey) -> list[str]:
    return [row.event_id async for row in survey.each(select(events)) if _differs(row)]


def _differs(row: Any) -> bool:  # a row of events
    body = json.loads(row.body)
    names = ("event_id", "delivery_id", "sequence", "type")
    return any(body[name] != getattr(row, name) for name in names)


EVENTS: Final = (
    Rule(
        "a delivery's events have no gap",
        select(deliveries.c.delivery_id).where(
            or_(
                _event_count() != deliveries.c.last_sequence,
                _event_count(events.c.sequence.between(1, deliveries.c.last_sequence))
                != deliveries.c.last_sequence,
            )
        ),
        _RESTORE,
    ),
    Rule("a delivery's events are those that were recorded", _changed, _RESTORE),
    Rule(
        "an event's columns say what its body says",
        _other_than_body,
        "Webhooks and streams choose events by the columns, and send the body. Set the columns to "
        "the values of the body if the chain of hashes holds; else restore the row.",
    ),
)

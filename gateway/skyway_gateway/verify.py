"""The invariants of the gateway's database; each violation is told as one JSON line."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from sqlalchemy import ColumnElement, Select, String, and_, cast, exists, func, or_, select

from skyway.runtime.database import Database
from skyway_gateway.notifications.stream import LAST_EVENTS
from skyway_gateway.tables import (
    custody,
    deliveries,
    events,
    missions,
    notifications,
    packages,
    webhooks,
)

#: A request is overdue when events are this much younger than its last moment, fleet ms.
_OVERDUE_MS: Final = 3_600_000

#: The terminal states are called as their events.
_is_over = deliveries.c.state.in_(
    sorted(kind.removeprefix("delivery.").upper() for kind in LAST_EVENTS)
)
_is_last_event = events.c.type.in_(sorted(LAST_EVENTS))
_is_own = events.c.delivery_id == deliveries.c.delivery_id


def _event_count(*conditions: ColumnElement[bool]) -> ColumnElement[int]:
    return select(func.count()).where(_is_own, *conditions).correlate(deliveries).scalar_subquery()


def _custody_of_package() -> ColumnElement[bool]:
    return and_(
        custody.c.delivery_id == packages.c.delivery_id,
        custody.c.package_id == packages.c.package_id,
    )


def _link_count(*conditions: ColumnElement[bool]) -> ColumnElement[int]:
    statement = select(func.count()).where(_custody_of_package(), *conditions)
    return statement.correlate(packages).scalar_subquery()


_package_name = packages.c.delivery_id + "/" + packages.c.package_id
_is_delivered = packages.c.state == "DELIVERED"
_is_with_recipient = packages.c.custodian_kind == "RECIPIENT"

_earlier = notifications.alias("earlier")
_newest = select(func.max(deliveries.c.updated_ms)).scalar_subquery()

#: What must not be found: rows of (subject,) by the sentence that they make false.
_CHECKS: Final[Mapping[str, Select[*tuple[Any, ...]]]] = {
    "I5: a request is decided in bounded time": select(deliveries.c.delivery_id).where(
        deliveries.c.state == "REQUESTED", deliveries.c.give_up_ms + _OVERDUE_MS < _newest
    ),
    "I5: a delivery that is over has told exactly one last event, as its last": select(
        deliveries.c.delivery_id
    ).where(
        _is_over,
        or_(
            _event_count(_is_last_event) != 1,
            _event_count(_is_last_event, events.c.sequence == deliveries.c.last_sequence) != 1,
        ),
    ),
    "I5: a delivery that goes on has told no last event": select(deliveries.c.delivery_id).where(
        ~_is_over, _event_count(_is_last_event) != 0
    ),
    "I5: a delivery under way has a mission under way": select(deliveries.c.delivery_id).where(
        ~_is_over,
        deliveries.c.state != "REQUESTED",
        ~exists().where(
            missions.c.delivery_id == deliveries.c.delivery_id,
            missions.c.state.in_(("BOOKED", "ACCEPTED", "ACTIVE")),
        ),
    ),
    "I6: a package's chain of custody has no gap": select(_package_name).where(
        or_(
            _link_count() != packages.c.custody_seq,
            _link_count(custody.c.seq.between(1, packages.c.custody_seq)) != packages.c.custody_seq,
        )
    ),
    "I6: a package's custodian is the last one of its chain": select(_package_name).where(
        _link_count(
            custody.c.seq == packages.c.custody_seq,
            custody.c.custodian_kind == packages.c.custodian_kind,
            custody.c.custodian_id == packages.c.custodian_id,
        )
        != 1
    ),
    "I6: a package is delivered once, and then with its recipient": select(_package_name).where(
        or_(
            _link_count(custody.c.custodian_kind == "RECIPIENT") > 1,
            and_(_is_delivered, ~_is_with_recipient),
            and_(~_is_delivered, _is_with_recipient),
        )
    ),
    "a delivery's events have no gap": select(deliveries.c.delivery_id).where(
        or_(
            _event_count() != deliveries.c.last_sequence,
            _event_count(events.c.sequence.between(1, deliveries.c.last_sequence))
            != deliveries.c.last_sequence,
        )
    ),
    "I14: an event is told to every webhook that wants it": select(events.c.event_id)
    .join(deliveries, _is_own)
    .join(webhooks, webhooks.c.customer_id == deliveries.c.customer_id)
    .where(
        webhooks.c.state == "ACTIVE",
        webhooks.c.changed_wall_ms < events.c.recorded_wall_ms,
        or_(
            webhooks.c.event_types.is_(None),
            webhooks.c.event_types.contains('"' + cast(events.c.type, String) + '"'),
        ),
        ~exists().where(
            notifications.c.webhook_id == webhooks.c.webhook_id,
            notifications.c.event_id == events.c.event_id,
        ),
    ),
    "I14: notifications of a delivery arrive in sequence": select(notifications.c.event_id).where(
        notifications.c.state == "DELIVERED",
        exists().where(
            _earlier.c.webhook_id == notifications.c.webhook_id,
            _earlier.c.delivery_id == notifications.c.delivery_id,
            _earlier.c.sequence < notifications.c.sequence,
            _earlier.c.state == "PENDING",
            ~_earlier.c.is_replay,
        ),
    ),
}


async def violations(db: Database) -> Sequence[Mapping[str, str]]:
    """Every violation: the rule that is broken, and by whom."""
    found: list[Mapping[str, str]] = []
    async with db.read() as connection:
        for rule, statement in _CHECKS.items():
            subjects = (await connection.execute(statement)).scalars()
            found.extend({"rule": rule, "subject": str(subject)} for subject in subjects)
    return found

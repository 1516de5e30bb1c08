"""The invariants of the gateway's database (docs/reference/invariants.md)."""

from typing import Final

from sqlalchemy import ColumnElement, String, and_, cast, exists, func, or_, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.violations import Rules, Violation, check_of, violations_found
from skyway_gateway.notifications.stream_events import LAST_EVENTS
from skyway_gateway.tables import (
    custody,
    deliveries,
    events,
    missions,
    notifications,
    packages,
    webhooks,
)

#: A request is overdue when other deliveries were written this long after its end, fleet ms.
_OVERDUE_MS: Final = 3_600_000

#: The final states have the names of their events.
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

_is_of_delivery = packages.c.delivery_id == deliveries.c.delivery_id
_is_settled = packages.c.state.in_(("DELIVERED", "RETURNED", "STRANDED", "CANCELLED"))
_has_waiting = exists().where(
    _is_of_delivery, packages.c.state == "CREATED", packages.c.mission_id.is_(None)
)
_is_its_mission = and_(
    missions.c.mission_id == packages.c.mission_id,
    missions.c.delivery_id == packages.c.delivery_id,
)
_is_live = missions.c.state.in_(LIVE_MISSION_STATES)

_earlier = notifications.alias("earlier")
_newest = select(func.max(deliveries.c.updated_ms)).scalar_subquery()

#: The sentences that must hold, each with the statement that finds what breaks it.
_RULES: Final[Rules] = {
    "I5: a request is decided in bounded time": select(deliveries.c.delivery_id).where(
        deliveries.c.is_queued, deliveries.c.give_up_ms + _OVERDUE_MS < _newest
    ),
    "I5: a delivery is queued while packages of it wait": select(deliveries.c.delivery_id).where(
        deliveries.c.is_queued != and_(~_is_over, _has_waiting)
    ),
    "I5: a request that nobody flies is queued": select(deliveries.c.delivery_id).where(
        deliveries.c.state == "REQUESTED", ~deliveries.c.is_queued
    ),
    "I5: a delivery that is over has exactly one final event, as its last": select(
        deliveries.c.delivery_id
    ).where(
        _is_over,
        or_(
            _event_count(_is_last_event) != 1,
            _event_count(_is_last_event, events.c.sequence == deliveries.c.last_sequence) != 1,
        ),
    ),
    "I5: a delivery that goes on has no final event": select(deliveries.c.delivery_id).where(
        ~_is_over, _event_count(_is_last_event) != 0
    ),
    "I5: a delivery under way has a mission under way, or packages that wait for one": select(
        deliveries.c.delivery_id
    ).where(
        ~_is_over,
        deliveries.c.state != "REQUESTED",
        ~_has_waiting,
        ~exists().where(missions.c.delivery_id == deliveries.c.delivery_id, _is_live),
    ),
    "I5: a delivery is over when all its packages are": select(deliveries.c.delivery_id).where(
        _is_over != ~exists().where(_is_of_delivery, ~_is_settled)
    ),
    "I6: a package on its way has one mission, which is under way": select(_package_name).where(
        ~_is_settled,
        or_(packages.c.mission_id.is_not(None), packages.c.state != "CREATED"),
        ~exists().where(_is_its_mission, _is_live),
    ),
    "I6: a package's mission is one of its delivery's": select(_package_name).where(
        packages.c.mission_id.is_not(None), ~exists().where(_is_its_mission)
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
    "I14: each webhook is notified of each event that it subscribes to": select(events.c.event_id)
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


_CHECK: Final = check_of(_RULES)


async def violations(db: Database) -> list[Violation]:
    """All violations: the broken rule and the subject that breaks it."""
    async with db.survey() as connection:
        return await violations_found(connection, _CHECK)

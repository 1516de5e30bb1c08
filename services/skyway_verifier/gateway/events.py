"""The rules of events and notifications.

What a customer was notified of never changes. Each webhook gets each event, in sequence, or visibly
not (I14).
"""

import json
from typing import Any, Final

from skyway_gateway.delivery_tables import deliveries, exchanges, missions
from skyway_gateway.notifications.event_store import hash_after
from skyway_gateway.notifications.webhook import LONGEST_PAUSE_S, MOST_ATTEMPTS
from skyway_gateway.tables import events, notifications, pruned, webhook_attempts, webhooks
from sqlalchemy import String, and_, cast, exists, func, or_, select

from skyway_verifier.finders import any_of, ms_of, repeats, rows_where
from skyway_verifier.gateway.deliveries import event_count
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import later_than

_is_own = events.c.delivery_id == deliveries.c.delivery_id

_earlier = notifications.alias("earlier")

_is_of_event = events.c.event_id == notifications.c.event_id

_is_its_attempt = and_(
    webhook_attempts.c.webhook_id == notifications.c.webhook_id,
    webhook_attempts.c.event_id == notifications.c.event_id,
    webhook_attempts.c.number == notifications.c.attempts,
)

#: The clocks of two machines may differ by this, wall ms.
_CLOCKS_DIFFER_MS: Final = 600_000

#: The attempts for events from before this wall time may have been deleted because of their age.
_attempts_since_ms = func.coalesce(
    select(pruned.c.before_wall_ms + _CLOCKS_DIFFER_MS)
    .where(pruned.c.table_name == webhook_attempts.name)
    .scalar_subquery(),
    0,
)
_has_kept_attempts = exists().where(_is_of_event, events.c.recorded_wall_ms >= _attempts_since_ms)

_RESTORE: Final = (
    "Events are what the customer was notified of. Restore the rows of `events` from a backup; the "
    "customer's webhook has received the same bodies."
)

_SEND_AGAIN: Final = (
    "Ask for the events again: POST /v1/webhooks/{id}/replay with the event's id. The webhook may "
    "then receive an event twice, under the same id."
)


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


def _differs(row: Any) -> bool:  # a row of events
    names = ("event_id", "delivery_id", "sequence", "type")
    return not repeats(row, json.loads(row.body), *names)


async def _other_exchanges(survey: Survey) -> list[str]:
    """The events that do not say the same as the exchanges of both providers."""
    noted: dict[str, dict[str, Any]] = {}
    async for row in survey.each(select(exchanges)):
        noted.setdefault(row.event_id, {})[row.direction] = row
    found = []
    async for row in survey.each(select(events).where(events.c.type == "delivery.replanned")):
        event = json.loads(row.body)
        is_exchange = event["data"]["code"] == "PROVIDER_CHANGED"
        if is_exchange and not _is_noted(event, noted.pop(row.event_id, {})):
            found.append(row.event_id)
    return [*found, *noted]


def _is_noted(event: dict[str, Any], sides: dict[str, Any]) -> bool:
    """Whether a provider loses the mission of this event, and the one that it names gets it."""
    came, left = sides.get("CAME"), sides.get("LEFT")
    if came is None or left is None or left.provider_id == came.provider_id:
        return False
    data = {**event["data"], "delivery_id": event["delivery_id"]}
    at_ms = ms_of(event["occurred_at"])
    return (
        repeats(came, data, "provider_id", "delivery_id", "mission_id")
        and repeats(left, data, "delivery_id", "mission_id")
        and came.at_ms == left.at_ms == at_ms
    )


async def _other_flown(survey: Survey) -> list[str]:
    """Missions whose flown times are not those of the last event of a package that they ended."""
    flown: dict[str, Any] = {}
    handed_over = events.c.type == "package.delivered"
    async for row in survey.each(select(events).where(handed_over).order_by(events.c.sequence)):
        data = json.loads(row.body)["data"]
        flown[data["mission_id"]] = (data.get("evidence") or {}).get("flown", {})
    names = ("flight_s", "waiting_s", "recharging_s")
    none = dict.fromkeys(names)
    return [
        row.mission_id
        async for row in survey.each(select(missions))
        if not repeats(row, none | flown.get(row.mission_id, {}), *names)
    ]


EVENTS: Final = (
    Rule(
        "a mission flew as long as the drone's evidence says",
        _other_flown,
        "Set the columns to `data.evidence.flown` of the mission's last event `package.delivered`.",
    ),
    Rule(
        "a delivery's events have no gap",
        any_of(
            deliveries.c.delivery_id,
            event_count() != deliveries.c.last_sequence,
            event_count(events.c.sequence.between(1, deliveries.c.last_sequence))
            != deliveries.c.last_sequence,
        ),
        _RESTORE,
    ),
    Rule("a delivery's events are those that were recorded", _changed, _RESTORE),
    Rule(
        "both providers of an exchange see it as its event says",
        _other_exchanges,
        "Providers read these rows of `exchanges`, and nothing else depends on them. Restore the "
        "rows of the event from a backup; without its event, delete the row.",
    ),
    Rule(
        "an event's columns say what its body says",
        rows_where(select(events), _differs, "event_id"),
        "Webhooks and streams choose events by the columns, and send the body. Set the columns to "
        "the values of the body if the chain of hashes holds; else restore the row.",
    ),
)

NOTIFICATIONS: Final = (
    Rule(
        "I13 a webhook is notified of deliveries of its own customer",
        select(notifications.c.event_id)
        .join(webhooks, webhooks.c.webhook_id == notifications.c.webhook_id)
        .join(deliveries, deliveries.c.delivery_id == notifications.c.delivery_id)
        .where(webhooks.c.customer_id != deliveries.c.customer_id),
        "The delivery or the webhook was given to another customer. The customer's quotes and "
        "other deliveries show who it was: correct `customer_id`.",
    ),
    Rule(
        "a webhook says why it is disabled, and when it changed",
        any_of(
            webhooks.c.webhook_id,
            (webhooks.c.state == "ACTIVE") & webhooks.c.disabled_reason.is_not(None),
            webhooks.c.changed_wall_ms < webhooks.c.created_wall_ms,
        ),
        "Set `changed_wall_ms` to now: from then on the webhook is notified of all events.",
    ),
    Rule(
        "an attempt at a webhook is about its event, and is tried again as its outcome says",
        select(webhook_attempts.c.attempt_id)
        .outerjoin(events, events.c.event_id == webhook_attempts.c.event_id)
        .where(
            or_(
                events.c.type != webhook_attempts.c.event_type,
                events.c.delivery_id != webhook_attempts.c.delivery_id,
                ~webhook_attempts.c.number.between(1, MOST_ATTEMPTS),
                webhook_attempts.c.duration_ms < 0,
                (webhook_attempts.c.outcome == "FAILED")
                != webhook_attempts.c.next_try_wall_ms.is_not(None),
            )
        ),
        "Only its customer reads the row of `webhook_attempts`: correct it by the event.",
    ),
    Rule(
        "I14 each webhook is notified of each event that it subscribes to",
        select(events.c.event_id)
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
        _SEND_AGAIN,
    ),
    Rule(
        "I14 notifications of a delivery arrive in sequence",
        select(notifications.c.event_id).where(
            notifications.c.state == "DELIVERED",
            exists().where(
                _earlier.c.webhook_id == notifications.c.webhook_id,
                _earlier.c.delivery_id == notifications.c.delivery_id,
                _earlier.c.sequence < notifications.c.sequence,
                _earlier.c.state == "PENDING",
                ~_earlier.c.is_replay,
            ),
        ),
        _SEND_AGAIN,
    ),
    Rule(
        "I14 a notification that was delivered or tried has its attempt",
        any_of(
            notifications.c.event_id,
            and_(
                notifications.c.state == "DELIVERED",
                _has_kept_attempts,
                ~exists().where(_is_its_attempt, webhook_attempts.c.outcome == "DELIVERED"),
            ),
            and_(
                notifications.c.attempts > 0,
                _has_kept_attempts,
                ~exists().where(_is_its_attempt),
            ),
            ~notifications.c.attempts.between(0, MOST_ATTEMPTS),
        ),
        "Nothing shows that the webhook has received it. " + _SEND_AGAIN,
    ),
    Rule(
        "I14 a notification is about its event",
        select(notifications.c.event_id).where(
            ~exists().where(
                _is_of_event,
                events.c.delivery_id.is_not_distinct_from(notifications.c.delivery_id),
                events.c.sequence == notifications.c.sequence,
            )
        ),
        "Set `delivery_id` and `sequence` to those of the event.",
    ),
    Rule(
        "I14 a notification is tried again within its schedule",
        later_than(
            lambda survey: survey.wall_ms + int(LONGEST_PAUSE_S * 1000),
            [notifications.c.next_try_wall_ms],
            notifications.c.state == "PENDING",
        ),
        "Set `next_try_wall_ms` to 0: it is sent with the next round.",
    ),
)

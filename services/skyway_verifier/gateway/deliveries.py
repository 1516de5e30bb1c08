"""The rules of deliveries, of their missions, and of the offers that they accepted.

A delivery ends once, as its packages did (I5), and has the limits that its customer was promised.
"""

import json
from typing import Any, Final

from skyway_gateway.deliveries.lifecycle.delivery import SETTLED_PACKAGE_STATES, TERMINAL_STATES
from skyway_gateway.delivery_tables import deliveries, missions, packages
from skyway_gateway.notifications.delivery_events import LAST_EVENTS
from skyway_gateway.tables import events, quotes
from sqlalchemy import ColumnElement, and_, exists, func, or_, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.delivery.lateness import Conditions
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.delivery.request import DeliveryRequest
from skyway.units import moment_to_ms
from skyway_verifier.finders import any_of, differs, ms_of, repeats, rows_where
from skyway_verifier.rule import Rule, Survey
from skyway_verifier.storage_rules import later_than

#: A request is overdue when other deliveries were written this long after its end, fleet ms.
_OVERDUE_MS: Final = 3_600_000

#: The longest wait for the next booking round is 3 s; clocks of machines may differ. Wall ms.
_LONGEST_WAIT_MS: Final = 600_000

_is_over = deliveries.c.state.in_(sorted(TERMINAL_STATES))
_is_last_event = events.c.type.in_(sorted(LAST_EVENTS))
_is_own = events.c.delivery_id == deliveries.c.delivery_id
_is_of_delivery = packages.c.delivery_id == deliveries.c.delivery_id
_is_settled = packages.c.state.in_(sorted(SETTLED_PACKAGE_STATES))
_has_waiting = exists().where(
    _is_of_delivery, packages.c.state == "CREATED", packages.c.mission_id.is_(None)
)
_is_live = missions.c.state.in_(LIVE_MISSION_STATES)
_newest = select(func.max(deliveries.c.updated_ms)).scalar_subquery()
_all_delivered = ~exists().where(_is_of_delivery, packages.c.state != "DELIVERED")
_any_delivered = exists().where(_is_of_delivery, packages.c.state == "DELIVERED")

_FROM_EVENTS: Final = (
    "The delivery's events are what its customer was notified of: `GET "
    "/v1/deliveries/{id}/events`. Correct the row so that it agrees with them."
)
_REQUEUE: Final = (
    "Set `is_queued` to true and `next_try_wall_ms` to 0: booking looks at the delivery again, and "
    "books it or gives it up."
)

#: The columns that `missions.body` repeats.
_REPEATED: Final = ("mission_id", "delivery_id", "attempt", "trip", "provider_id", "drone_id")

_HAVE_ENDED: Final = ("COMPLETED", "ABORTED", "CANCELLED")


def event_count(*conditions: ColumnElement[bool]) -> ColumnElement[int]:
    """How many events of a delivery meet these conditions."""
    return select(func.count()).where(_is_own, *conditions).correlate(deliveries).scalar_subquery()


async def _other_packages(survey: Survey) -> list[str]:
    """Deliveries whose packages are not those of the request."""
    stored: dict[str, dict[str, Any]] = {}
    query = select(packages)
    async for row in survey.each(query):
        place = (row.number, row.destination_station_id, row.mass_kg)
        stored.setdefault(row.delivery_id, {})[row.package_id] = place
    query = select(events).where(events.c.type == "delivery.changed").order_by(events.c.sequence)
    changed = {
        row.delivery_id: json.loads(row.body)["data"]["reference"]
        async for row in survey.each(query)
    }
    query = select(deliveries.c.delivery_id, deliveries.c.reference, deliveries.c.request)
    return [
        row.delivery_id
        async for row in survey.each(query)
        for reference, asked in [_requested(row.request)]
        if asked != stored.get(row.delivery_id, {})
        or row.reference != changed.get(row.delivery_id, reference)
    ]


def _requested(text: str) -> tuple[str | None, dict[str, Any]]:
    """The reference of a request, and each package's number, destination and mass."""
    request = json.loads(text)
    return request["reference"], {
        each["package_id"]: (number, each["destination"]["station_id"], each["mass_kg"])
        for number, each in enumerate(request["packages"])
    }


def _differs(row: Any) -> bool:  # a row of missions
    body = json.loads(row.body)
    price, begun_at = body["price"], body["booked_start_at"]
    return (
        not repeats(row, body, *_REPEATED)
        or differs(row, {"price_amount": price["amount"], "currency": price["currency"]})
        or row.start_ms not in (None, ms_of(begun_at))
    )


def _is_promised_oddly(row: Any) -> bool:  # a row of missions
    """Whether its promise counts time on pads without a recharge."""
    known = Conditions.read(row.promised_on)
    return known.recharging_share > 0 and known.recharges == 0


_later = events.alias("later")

#: Each delivery with its first event, and the last event that has changed its request.
_BEGUN: Final = (
    select(
        deliveries,
        events.c.body,
        select(_later.c.body)
        .where(
            _later.c.delivery_id == deliveries.c.delivery_id,
            _later.c.type == "delivery.changed",
            _later.c.body.not_like('%"request":null%'),
        )
        .order_by(_later.c.sequence.desc())
        .limit(1)
        .scalar_subquery()
        .label("rescheduled"),
    )
    .join(events, _is_own)
    .where(events.c.sequence == 1)
)


def _began_otherwise(row: Any) -> bool:  # a row of _BEGUN
    event, request = json.loads(row.body), DeliveryRequest.read(row.request)
    asked = event if row.rescheduled is None else json.loads(row.rescheduled)
    earliest_at = request.first_hand_over_at
    earliest_ms = None if earliest_at is None else moment_to_ms(earliest_at)
    return (
        abs(row.created_ms - ms_of(event["occurred_at"])) > 1
        or row.earliest_pickup_ms != earliest_ms
        or DeliveryRequest.model_validate(asked["data"]["request"]) != request
        or (row.waits_since_ms is not None and row.waits_since_ms < row.created_ms - 1)
        or min(row.updated_ms, row.give_up_ms) < row.created_ms - 1
    )


DELIVERIES: Final = (
    Rule(
        "a delivery began as its first event says, and waits and ends later",
        rows_where(_BEGUN, _began_otherwise, "delivery_id"),
        _FROM_EVENTS,
    ),
    Rule(
        "I5 a request is decided in bounded time",
        select(deliveries.c.delivery_id).where(
            deliveries.c.is_queued, deliveries.c.give_up_ms + _OVERDUE_MS < _newest
        ),
        "Booking does not look at it: see the gateway's log for `booking postponed`, and whether "
        "registry and composition answer. " + _REQUEUE,
    ),
    Rule(
        "I5 booking looks at a queued delivery again within seconds",
        later_than(
            lambda survey: survey.wall_ms + _LONGEST_WAIT_MS,
            [deliveries.c.next_try_wall_ms],
            deliveries.c.is_queued,
        ),
        _REQUEUE,
    ),
    Rule(
        "I5 a delivery is queued while packages of it wait",
        select(deliveries.c.delivery_id).where(
            deliveries.c.is_queued
            != and_(~_is_over, deliveries.c.state != "SCHEDULED", _has_waiting)
        ),
        "Set `is_queued` to whether the delivery goes on, is not SCHEDULED, and a package of it is "
        "CREATED without a mission.",
    ),
    Rule(
        "I5 a scheduled delivery is requested before its pickup",
        select(deliveries.c.delivery_id).where(
            deliveries.c.state == "SCHEDULED",
            or_(
                deliveries.c.earliest_pickup_ms.is_(None),
                deliveries.c.earliest_pickup_ms + _OVERDUE_MS < _newest,
            ),
        ),
        "The gateway's loop `scheduled` does not run: see its log. Set `earliest_pickup_ms` to the "
        "moment in `request`; the loop then sets the state REQUESTED.",
    ),
    Rule(
        "I5 a request that waits for a drone is queued",
        select(deliveries.c.delivery_id).where(
            deliveries.c.waits_since_ms.is_not(None), ~deliveries.c.is_queued
        ),
        "Others see it before them in the order of waiting. Set `waits_since_ms` to null.",
    ),
    Rule(
        "I5 requests wait in the order of their classes",
        rows_where(
            select(deliveries).where(deliveries.c.is_queued),
            lambda row: (
                row.queue_rank != PRIORITY_RANKS[DeliveryRequest.read(row.request).qos.priority]
            ),
            "delivery_id",
        ),
        "Set `queue_rank` to 0 where `request` has the priority PRIORITY, else to 1.",
    ),
    Rule(
        "I5 a request that nobody flies is queued",
        select(deliveries.c.delivery_id).where(
            deliveries.c.state == "REQUESTED", ~deliveries.c.is_queued
        ),
        _REQUEUE,
    ),
    Rule(
        "I5 a delivery that is over has exactly one final event, as its last",
        select(deliveries.c.delivery_id).where(
            _is_over,
            or_(
                event_count(_is_last_event) != 1,
                event_count(
                    _is_last_event,
                    events.c.sequence == deliveries.c.last_sequence,
                    events.c.type == "delivery." + func.lower(deliveries.c.state),
                )
                != 1,
            ),
        ),
        _FROM_EVENTS,
    ),
    Rule(
        "I5 a delivery that goes on has no final event",
        select(deliveries.c.delivery_id).where(~_is_over, event_count(_is_last_event) != 0),
        _FROM_EVENTS,
    ),
    Rule(
        "I5 a delivery under way has a mission under way, or packages that wait for one",
        select(deliveries.c.delivery_id).where(
            ~_is_over,
            deliveries.c.state != "REQUESTED",
            ~_has_waiting,
            ~exists().where(missions.c.delivery_id == deliveries.c.delivery_id, _is_live),
        ),
        "Nothing will end this delivery. Composition knows how its missions ended (GET "
        "/v1/missions?delivery_id=...): correct the missions' states and the packages.",
    ),
    Rule(
        "I5 a delivery is over when all its packages are",
        select(deliveries.c.delivery_id).where(
            _is_over != ~exists().where(_is_of_delivery, ~_is_settled)
        ),
        _FROM_EVENTS,
    ),
    Rule(
        "I5 a delivery ends as its packages did",
        any_of(
            deliveries.c.delivery_id,
            and_(deliveries.c.state == "COMPLETED", ~_all_delivered),
            and_(
                deliveries.c.state == "PARTIALLY_COMPLETED",
                or_(_all_delivered, ~_any_delivered),
            ),
            and_(deliveries.c.state.in_(("CANCELLED", "FAILED", "REJECTED")), _any_delivered),
        ),
        _FROM_EVENTS,
    ),
    Rule(
        "a delivery has the packages of its request",
        _other_packages,
        "Correct the rows of `packages` by `deliveries.request`, which is what the customer asked "
        "for; its first event has the same request.",
    ),
)

MISSIONS: Final = (
    Rule(
        "a mission's columns say what its body says",
        rows_where(select(missions), _differs, "mission_id"),
        "Composition has the same mission (GET /v1/missions/{id}): correct the value that differs. "
        "Earnings and statistics read the columns.",
    ),
    Rule(
        "what was known when a mission was promised fits together",
        rows_where(
            select(missions).where(missions.c.promised_on.is_not(None)),
            _is_promised_oddly,
            "mission_id",
        ),
        "Set `promised_on` to null: then the mission counts less for the P90 of later packages.",
    ),
    Rule(
        "a mission that is over has its end",
        any_of(
            missions.c.mission_id,
            and_(missions.c.state.in_(_HAVE_ENDED), missions.c.ended_ms.is_(None)),
            and_(missions.c.state.in_(LIVE_MISSION_STATES), missions.c.ended_ms.is_not(None)),
        ),
        "Composition knows whether the mission is over (GET /v1/missions/{id}): correct `state` or "
        "`ended_ms`.",
    ),
    Rule(
        "a mission belongs to an attempt that was made",
        any_of(
            missions.c.mission_id,
            missions.c.trip < 1,
            missions.c.attempt < 1,
            ~exists().where(
                deliveries.c.delivery_id == missions.c.delivery_id,
                deliveries.c.attempt >= missions.c.attempt,
            ),
        ),
        "A lower `deliveries.attempt` than that of a mission makes booking repeat an attempt, and "
        "composition answers with the old missions. Set it to one more than the last attempt.",
    ),
)


_ACCEPTED: Final = select(
    deliveries.c.delivery_id, deliveries.c.offer, quotes.c.offers, quotes.c.taken_offer_id
).join(quotes, quotes.c.delivery_id == deliveries.c.delivery_id)


def _has_other_limits(row: Any) -> bool:  # a row of _ACCEPTED
    accepted = [each for each in json.loads(row.offers) if each["offer_id"] == row.taken_offer_id]
    if row.offer is None or not accepted:
        return True
    limits, [offer] = json.loads(row.offer), accepted
    if (limits["provider_id"], limits["tariff"]) != (offer["provider_id"], offer["tariff"]):
        return True
    # The customer has changed the request since: the offer was made anew, and is not held.
    if limits.get("hold") is None:
        return False
    promised: bool = (limits["price"], limits["within_s"]) == (
        offer["price"],
        offer["delivery_time_s"],
    )
    return not promised


#: Reasons whose cause always comes after the acceptance: a drone refused, the deadline passed, or
#: the pickup has left the network.
_LATER_CAUSES: Final = frozenset({"REFUSED", "TOO_LATE", "DESTINATION_UNREACHABLE"})


_REJECTED: Final = select(deliveries.c.delivery_id, deliveries.c.offer, deliveries.c.reasons).where(
    deliveries.c.state == "REJECTED", deliveries.c.offer.is_not(None)
)


def _is_lost_without_cause(row: Any) -> bool:  # a row of _REJECTED
    """Whether it was rejected although its offer was held when it was accepted."""
    return json.loads(row.offer).get("hold") is not None and not any(
        each["code"] in _LATER_CAUSES or "hold_loss" in each.get("data", {})
        for each in json.loads(row.reasons)
    )


#: Far more than offers last, held or not. Wall ms.
_LONGEST_OFFER_MS: Final = 86_400_000

OFFERS: Final = (
    Rule(
        "I17 an accepted offer is flown, or its failure has a cause after the acceptance",
        rows_where(_REJECTED, _is_lost_without_cause, "delivery_id"),
        "The delivery was REJECTED although composition held its offer, and no reason says what "
        "happened after the acceptance. Find the reason in the logs, and inform the customer.",
    ),
    Rule(
        "a quote can be accepted for a day at most",
        later_than(lambda survey: survey.wall_ms + _LONGEST_OFFER_MS, [quotes.c.expires_wall_ms]),
        "Set `expires_wall_ms` to now: its offers are no longer true.",
    ),
    Rule(
        "an accepted quote has its delivery",
        any_of(
            quotes.c.quote_id,
            quotes.c.delivery_id.is_not(None) != quotes.c.taken_offer_id.is_not(None),
            quotes.c.delivery_id.is_not(None)
            & ~exists().where(
                deliveries.c.delivery_id == quotes.c.delivery_id,
                deliveries.c.customer_id == quotes.c.customer_id,
            ),
        ),
        "The quote names a delivery that does not exist or belongs to somebody else. Restore the "
        "delivery from a backup, or correct its `customer_id`.",
    ),
    Rule(
        "a delivery of an accepted offer has its limits",
        rows_where(_ACCEPTED, _has_other_limits, "delivery_id"),
        "The customer was promised the price and the time of the quote's accepted offer "
        "(`quotes.offers`), or only its tariff if the request has changed since. "
        "`deliveries.offer` must say the same. Correct what was changed.",
    ),
)

"""The rules of accepted offers: a delivery has the limits that its customer was promised."""

import json
from typing import Any, Final

from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import quotes
from sqlalchemy import exists, select

from skyway_verifier.finders import any_of, rows_where
from skyway_verifier.rule import Rule
from skyway_verifier.storage_rules import later_than

_ACCEPTED: Final = select(
    deliveries.c.delivery_id, deliveries.c.offer, quotes.c.offers, quotes.c.taken_offer_id
).join(quotes, quotes.c.delivery_id == deliveries.c.delivery_id)


def _has_other_limits(row: Any) -> bool:  # a row of _ACCEPTED
    accepted = [each for each in json.loads(row.offers) if each["offer_id"] == row.taken_offer_id]
    if row.offer is None or not accepted:
        return True
    limits, [offer] = json.loads(row.offer), accepted
    promised = (limits["provider_id"], limits["price"], limits["within_s"], limits.get("tariff"))
    return promised != (
        offer["provider_id"],
        offer["price"],
        offer["delivery_time_s"],
        offer.get("tariff"),
    )


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
        "(`quotes.offers`); `deliveries.offer` must say the same. Correct what was changed.",
    ),
)

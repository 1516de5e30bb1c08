"""The rules of accepted offers: a delivery has the limits that its customer was promised."""

import json
from typing import Any, Final

from sqlalchemy import exists, or_, select

from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.survey import Survey
from skyway_gateway.tables import deliveries, quotes


async def _other_limits(survey: Survey) -> list[str]:
    """Deliveries with other limits than the accepted offer of their quote."""
    query = select(
        deliveries.c.delivery_id, deliveries.c.offer, quotes.c.offers, quotes.c.taken_offer_id
    ).join(quotes, quotes.c.delivery_id == deliveries.c.delivery_id)
    return [row.delivery_id async for row in survey.each(query) if _differs(row)]


def _differs(row: Any) -> bool:  # a delivery with its quote
    accepted = [each for each in json.loads(row.offers) if each["offer_id"] == row.taken_offer_id]
    if row.offer is None or not accepted:
        return True
    limits, [offer] = json.loads(row.offer), accepted
    return (limits["provider_id"], limits["price"], limits["within_s"]) != (
        offer["provider_id"],
        offer["price"],
        offer["delivery_time_s"],
    )


OFFERS: Final = (
    Rule(
        "an accepted quote has its delivery",
        select(quotes.c.quote_id).where(
            or_(
                quotes.c.delivery_id.is_not(None) != quotes.c.taken_offer_id.is_not(None),
                quotes.c.delivery_id.is_not(None)
                & ~exists().where(
                    deliveries.c.delivery_id == quotes.c.delivery_id,
                    deliveries.c.customer_id == quotes.c.customer_id,
                ),
            )
        ),
        "The quote names a delivery that does not exist or belongs to somebody else. Restore the "
        "delivery from a backup, or correct its `customer_id`.",
    ),
    Rule(
        "a delivery of an accepted offer has its limits",
        _other_limits,
        "The customer was promised the price and the time of the quote's accepted offer "
        "(`quotes.offers`); `deliveries.offer` must say the same. Correct what was changed.",
    ),
)

"""What a provider has earned: the prices of its completed missions."""

from datetime import date
from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.delivery.offer import Currency
from skyway.ids import ProviderId
from skyway.json_model import JsonModel


class EarningsQuery(JsonModel):
    """Which missions count: those that ended in [from, to); without limits, all."""

    from_at: Annotated[FleetMoment | None, Field(alias="from")] = None
    to_at: Annotated[FleetMoment | None, Field(alias="to")] = None


class DayEarnings(JsonModel):
    """The earnings of one day in UTC, fleet time."""

    day: date
    currency: Currency
    deliveries: int
    missions: int
    amount: int


class Earnings(JsonModel):
    """A provider's earnings: the sums in the currency of the latest mission, and each day.

    Days in an earlier currency are listed, but not part of the sums.
    """

    provider_id: ProviderId
    currency: Currency | None
    deliveries: int
    missions: int
    amount: int
    by_day: tuple[DayEarnings, ...]


def earnings_of(provider_id: ProviderId, days: tuple[DayEarnings, ...]) -> Earnings:
    """The earnings with the sums over these days, which are sorted by time."""
    currency = days[-1].currency if days else None
    summed = [day for day in days if day.currency == currency]
    return Earnings(
        provider_id=provider_id,
        currency=currency,
        deliveries=sum(day.deliveries for day in summed),
        missions=sum(day.missions for day in summed),
        amount=sum(day.amount for day in summed),
        by_day=days,
    )

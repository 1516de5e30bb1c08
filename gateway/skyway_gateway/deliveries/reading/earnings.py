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

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Only missions that ended at this moment or later."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(alias="to", description="Only missions that ended before this moment."),
    ] = None


class DayEarnings(JsonModel):
    """The earnings of one day in UTC, fleet time."""

    day: Annotated[date, Field(description="The day in UTC, fleet time.")]
    currency: Currency
    deliveries: Annotated[
        int, Field(description="Deliveries with a mission that was completed on this day.")
    ]
    missions: Annotated[int, Field(description="Missions that were completed on this day.")]
    amount: Annotated[int, Field(description="What they brought, in minor units of the currency.")]


class Earnings(JsonModel):
    """A provider's earnings: the sums in the currency of the latest mission, and each day.

    Days in an earlier currency are listed, but not part of the sums.
    """

    provider_id: Annotated[ProviderId, Field(description="The provider.")]
    currency: Annotated[
        Currency | None,
        Field(description="The currency of the latest mission; null without missions."),
    ]
    deliveries: Annotated[int, Field(description="Deliveries on all days, in this currency.")]
    missions: Annotated[int, Field(description="Missions on all days, in this currency.")]
    amount: Annotated[int, Field(description="What they brought, in minor units of the currency.")]
    by_day: Annotated[
        tuple[DayEarnings, ...],
        Field(description="Each day with completed missions, the first day first."),
    ]


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

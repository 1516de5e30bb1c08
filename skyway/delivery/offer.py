"""What a provider asks for a plan: its tariff, the price, and which offer suits a QoS best."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from skyway.delivery.line_items import LineItem, LineKind, summed, whole_items
from skyway.delivery.payment_terms import PaymentTerms
from skyway.delivery.qos import Priority, Weights
from skyway.ids import DroneId, ProviderId
from skyway.json_model import JsonModel

Currency = Annotated[str, Field(pattern=r"^[A-Z]{3}$", max_length=3, description="ISO 4217 code")]

MinorUnits = Annotated[int, Field(ge=0, le=10**12)]

#: The highest price of a trip, in minor units: the price of a delivery with 100 trips is an amount
#: too. Without it the tariff of one provider could make the quotes of all providers fail.
MOST_OF_TRIP: Final = 10**10


#: Scores that agree in this many digits are equal: what is left of a difference is rounding.
_SCORE_DIGITS: Final = 9


#: Each no-show of a provider after the first raises the score of its offers by this share, up to
#: the most that are counted. Our own choice.
_NO_SHOW_SHARE: Final = 0.05
_MOST_NO_SHOWS: Final = 5


def no_show_factor(no_shows: int) -> float:
    """What the score of a provider's offers is multiplied by, 1 to 1.25.

    `no_shows` are its missions of the last days whose drones did not come. The first costs nothing:
    everybody may have bad luck.
    """
    return 1.0 + _NO_SHOW_SHARE * min(max(no_shows - 1, 0), _MOST_NO_SHOWS)


class Tariff(JsonModel):
    """How a provider prices a delivery, in minor units of `currency`."""

    currency: Currency = "USD"
    base: Annotated[MinorUnits, Field(description="Price of each delivery, in minor units.")] = 0
    per_km: Annotated[
        MinorUnits, Field(description="Price of each flown kilometre, in minor units.")
    ] = 0
    per_kg: Annotated[
        MinorUnits, Field(description="Price of each kilogram of payload, in minor units.")
    ] = 0
    per_recharge_minute: Annotated[
        MinorUnits, Field(description="Price of each minute on a pad, in minor units.")
    ] = 0
    minimum: Annotated[
        MinorUnits, Field(description="The least price of a delivery, in minor units.")
    ] = 0
    priority_factor: Annotated[
        float,
        Field(
            ge=1,
            le=10,
            allow_inf_nan=False,
            description="A PRIORITY delivery costs its price times this factor, 1 to 10.",
        ),
    ] = 1.5
    pooled_factor: Annotated[
        float,
        Field(
            ge=0,
            le=1,
            allow_inf_nan=False,
            description="A delivery on a shared trip costs its price times this factor, 0 to 1.",
        ),
    ] = 1.0
    payment_terms: Annotated[
        PaymentTerms,
        Field(description="What a customer gets back for a cancellation, and for late packages."),
    ] = PaymentTerms()

    def factor_of(self, priority: Priority) -> float:
        """What the price of a request of this class is multiplied by."""
        return self.priority_factor if priority == "PRIORITY" else 1.0


class Price(JsonModel):
    """An amount of money in minor units, and what it is made of."""

    amount: Annotated[
        MinorUnits, Field(description="Amount in minor units of the currency, such as cents.")
    ]
    currency: Currency
    line_items: Annotated[
        tuple[LineItem, ...],
        Field(
            exclude_if=lambda value: not value,
            description="What the amount is made of; the items sum to it. Without items the amount "
            "is 0, or a limit.",
        ),
    ] = ()

    @model_validator(mode="after")
    def _adds_up(self) -> Self:
        total = sum(item.amount for item in self.line_items)
        if self.line_items and total != self.amount:
            raise ValueError(f"the line items sum to {total}, not to the amount {self.amount}")
        return self

    @property
    def itemised(self) -> tuple[LineItem, ...]:
        """The line items, at least one; an amount without items is a base price."""
        return self.line_items or (LineItem(kind="BASE", amount=self.amount),)

    def pooled(self, tariff: Tariff) -> "Price":
        """The price of a delivery that shares its trip; it is never higher."""
        return self.plus("POOLED", round(self.amount * tariff.pooled_factor) - self.amount)

    def plus(self, kind: LineKind, amount: int) -> "Price":
        """The price with an item more; a negative amount is given back."""
        items = summed((*self.itemised, LineItem(kind=kind, amount=amount)))
        return self.model_copy(update={"amount": self.amount + amount, "line_items": items})


def total_price(prices: Sequence[Price]) -> Price:
    """The sum of prices, at least one, which share one currency."""
    items = summed(item for price in prices for item in price.itemised)
    amount = sum(price.amount for price in prices)
    return prices[0].model_copy(update={"amount": amount, "line_items": items})


def price_of(
    tariff: Tariff,
    *,
    distance_m: float,
    payload_kg: float,
    recharging_s: float,
    priority: Priority = "STANDARD",
) -> Price:
    """The price of flying a plan, rounded to the nearest minor unit, at least the minimum.

    PRIORITY multiplies it, the minimum too, by the tariff's factor. The line items sum to it. A
    price above `MOST_OF_TRIP` is cut to it, and has one item.
    """
    parts: dict[LineKind, float] = {
        "BASE": tariff.base,
        "DISTANCE": tariff.per_km * distance_m / 1000,
        "MASS": tariff.per_kg * payload_kg,
        "RECHARGING": tariff.per_recharge_minute * recharging_s / 60,
    }
    flown = round(sum(parts.values()))
    least = max(tariff.minimum, flown)
    amount = round(least * tariff.factor_of(priority))
    if amount > MOST_OF_TRIP:
        most = LineItem(kind="BASE", amount=MOST_OF_TRIP)
        return Price(amount=MOST_OF_TRIP, currency=tariff.currency, line_items=(most,))
    price = Price(amount=flown, currency=tariff.currency, line_items=whole_items(parts, flown))
    return price.plus("MINIMUM", least - flown).plus("PRIORITY", amount - least)


@dataclass(frozen=True, slots=True)
class OfferValues:
    """What ranking looks at: time to the last delivery, price, energy, no-shows; names for ties."""

    time_s: float
    price: int
    energy_j: float
    provider_id: ProviderId
    drone_id: DroneId
    no_shows: int = 0


@dataclass(frozen=True, slots=True)
class BestValues:
    """The best time, price and energy among some offers: what a score is relative to."""

    time_s: float
    price: int
    energy_j: float

    @classmethod
    def of(cls, offers: Iterable[OfferValues]) -> Self:
        """The best values of these offers, of which there is at least one."""
        times_s, prices, energies_j = zip(
            *((each.time_s, each.price, each.energy_j) for each in offers), strict=True
        )
        return cls(min(times_s), min(prices), min(energies_j))

    def score(self, offer: OfferValues, weights: Weights) -> float:
        """The sum of weight x value / best value, times `no_show_factor`, the lower the better.

        What weighs nothing is not looked at, however much it is.
        """
        score = 0.0
        if weights.time > 0:
            score += weights.time * _relative(offer.time_s, self.time_s)
        if weights.price > 0:
            score += weights.price * _relative(offer.price, self.price)
        if weights.energy > 0:
            score += weights.energy * _relative(offer.energy_j, self.energy_j)
        return score * no_show_factor(offer.no_shows)

    def rank(self, offer: OfferValues, weights: Weights) -> tuple[float, int, ProviderId, DroneId]:
        """What offers are sorted by: the score, then price, provider and drone."""
        score = round(self.score(offer, weights), _SCORE_DIGITS)
        return score, offer.price, offer.provider_id, offer.drone_id


def rank_offers(offers: Sequence[OfferValues], weights: Weights) -> list[int]:
    """The offers' indices, best first.

    The score sums weight x value / best value among the offers, and is higher for a provider with
    repeated no-shows; ties go by price, provider, drone.
    """
    if not offers:
        return []
    best = BestValues.of(offers)
    return sorted(range(len(offers)), key=lambda index: best.rank(offers[index], weights))


def _relative(value: float, best: float) -> float:
    """How many times the best value this is; 1 + value where the best is free or takes no time."""
    return value / best if best > 0 else 1.0 + value

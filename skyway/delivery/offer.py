"""What a provider asks for a plan: its tariff, the price, and which offer suits a QoS best."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from skyway.delivery.request import Weights
from skyway.ids import DroneId, ProviderId
from skyway.json_model import JsonModel

Currency = Annotated[str, Field(pattern=r"^[A-Z]{3}$", description="ISO 4217 code")]

MinorUnits = Annotated[int, Field(ge=0, le=10**12)]


class Tariff(JsonModel):
    """How a provider prices a delivery, in minor units of `currency`."""

    currency: Currency = "USD"
    base: MinorUnits = 0
    per_km: MinorUnits = 0
    per_kg: MinorUnits = 0
    per_recharge_minute: MinorUnits = 0
    minimum: MinorUnits = 0


class Price(JsonModel):
    """An amount of money in minor units."""

    amount: MinorUnits
    currency: Currency


def price_of(tariff: Tariff, *, distance_m: float, payload_kg: float, recharging_s: float) -> Price:
    """The price of flying a plan, rounded to the nearest minor unit, at least the minimum."""
    amount = (
        tariff.base
        + tariff.per_km * distance_m / 1000
        + tariff.per_kg * payload_kg
        + tariff.per_recharge_minute * recharging_s / 60
    )
    return Price(amount=max(tariff.minimum, round(amount)), currency=tariff.currency)


@dataclass(frozen=True, slots=True)
class OfferValues:
    """What ranking looks at: time to the last delivery, price, energy; names for ties."""

    time_s: float
    price: int
    energy_j: float
    provider_id: ProviderId
    drone_id: DroneId


def rank_offers(offers: Sequence[OfferValues], weights: Weights) -> list[int]:
    """The offers' indices, best first.

    The score sums weight x value / best value among the offers; ties go by price, provider, drone.
    """
    if not offers:
        return []
    best_time = min(offer.time_s for offer in offers)
    best_price = min(offer.price for offer in offers)
    best_energy = min(offer.energy_j for offer in offers)

    def score(index: int) -> tuple[float, int, ProviderId, DroneId]:
        offer = offers[index]
        total = (
            weights.time * _relative(offer.time_s, best_time)
            + weights.price * _relative(offer.price, best_price)
            + weights.energy * _relative(offer.energy_j, best_energy)
        )
        return total, offer.price, offer.provider_id, offer.drone_id

    return sorted(range(len(offers)), key=score)


def _relative(value: float, best: float) -> float:
    """How many times the best value this is; 1 + value where the best is free or takes no time."""
    return value / best if best > 0 else 1.0 + value

"""Gateway asks composition what could be offered for a request: nothing is reserved."""

from typing import Annotated

from pydantic import Field

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import Margins, PackageEta
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId, DroneModelId, ProviderId
from skyway.json_model import WireModel


class QuoteQuery(WireModel):
    """The body of POST /internal/quotes."""

    request: DeliveryRequest
    shortlist: Shortlist

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones to compare."""
        return self.shortlist.candidates


class OfferTerms(WireModel):
    """What one provider offers: its best drone's plan, or those of several trips, added up.

    `delivery_time_s` counts from the start of the first drone's plan, which may begin with a flight
    to the pickup, to the last delivery. Offers are ranked by `score`, the lower the better: the
    weighted sum of time, price and energy, each relative to the best among the offers.
    """

    provider_id: ProviderId
    drone_id: DroneId
    drone_model_id: DroneModelId
    price: Price
    pickup_at: Annotated[
        FleetMoment, Field(description="when the first drone begins to load at the pickup")
    ]
    delivery_time_s: float
    packages: tuple[PackageEta, ...]
    energy_j: float
    distance_m: float
    recharges: int
    recharging_s: float
    waiting_s: float
    trips: Annotated[int, Field(ge=1)] = 1
    margins: Margins
    score: float


class QuoteAnswer(WireModel):
    """One offer per provider, the best first, and why the other providers make none."""

    offers: tuple[OfferTerms, ...]
    infeasible: tuple[ProviderReason, ...]

"""Gateway asks composition what could be offered for a request, and has it hold offers.

Offers are held for a quote, or because a customer accepts one of them.
"""

from datetime import datetime
from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.margins import Margins
from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import OfferHold, OfferLimits, PackageEta
from skyway.contracts.shortlist import Shortlist
from skyway.contracts.weather import WeatherNote
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId, DroneModelId, HoldId, ProviderId, StationId, SubjectId
from skyway.json_model import WireModel

#: Wall seconds for which composition holds an offer longer than the offer says, so that an offer
#: that is accepted at its last moment is still held when composition is asked to keep it.
HOLD_GRACE_S: Final = 5.0

#: Why a booking did not use the drones and pads that were held for its offer.
HoldLoss = Literal[
    "EXPIRED", "NETWORK_CHANGED", "CALENDAR_CHANGED", "DRONE_NOT_FREE", "REQUEST_CHANGED"
]


class HoldTerms(WireModel):
    """The customer for whom offers are held, and the time."""

    hold_id: Annotated[HoldId, Field(description="Id for the new hold.")]
    customer_id: Annotated[SubjectId, Field(description="The customer who asks.")]
    life_s: Annotated[float, Field(gt=0, description="How long, seconds of wall time.")]
    most: Annotated[
        int, Field(ge=0, description="The quotes that the customer may hold at the same time.")
    ]


class QuoteQuery(WireModel):
    """The body of POST /internal/quotes."""

    request: Annotated[DeliveryRequest, Field(description="What the customer asks for.")]
    shortlist: Annotated[Shortlist, Field(description="The drones to compare.")]
    hold: Annotated[
        HoldTerms | None, Field(description="How the best offers are held; null: nothing is held.")
    ] = None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones to compare."""
        return self.shortlist.candidates


class OfferTerms(WireModel):
    """The offer of one provider: the plan of its best drone, or the sum of several trips.

    `delivery_time_s` counts from the start of the first drone's plan, which may begin with a flight
    to the pickup, to the last delivery. Offers are ranked by `score`, the lower the better: the
    weighted sum of time, price and energy, each relative to the best among the offers.
    """

    provider_id: ProviderId
    drone_id: DroneId
    drone_model_id: DroneModelId
    price: Annotated[Price, Field(description="What the delivery costs.")]
    pooled_price: Annotated[
        Price | None,
        Field(
            description="What it costs instead if its drone loads packages of other deliveries "
            "too; null if the request does not allow that, or the price would be the same."
        ),
    ] = None
    pickup_station_id: Annotated[
        StationId, Field(description="Where the packages are handed over to the drone.")
    ]
    pickup_at: Annotated[
        FleetMoment, Field(description="When the first drone begins to load at the pickup.")
    ]
    delivery_time_s: Annotated[
        float, Field(description="Seconds from the pickup to the last delivery.")
    ]
    packages: Annotated[tuple[PackageEta, ...], Field(description="When each package is expected.")]
    energy_j: Annotated[float, Field(description="Energy of the plan in joules.")]
    distance_m: Annotated[float, Field(description="Flown distance in metres.")]
    recharges: Annotated[int, Field(description="How often drones recharge.")]
    recharging_s: Annotated[float, Field(description="Seconds on pads.")]
    waiting_s: Annotated[float, Field(description="Seconds of waiting for pads.")]
    trips: Annotated[int, Field(ge=1, description="How many trips it takes, from 1.")] = 1
    ways: Annotated[
        tuple[tuple[StationId, ...], ...],
        Field(
            description="For each trip the stations that its packages pass, from the pickup to the "
            "last delivery."
        ),
    ]
    margins: Annotated[Margins, Field(description="What the plan has on top of what it needs.")]
    weather: Annotated[
        WeatherNote | None,
        Field(description="The forecast or measured wind that the plans use; null in still air."),
    ] = None
    score: Annotated[float, Field(description="What offers are ranked by; lower is better.")]
    no_shows: Annotated[
        int,
        Field(
            ge=0,
            description="Missions of the provider within 7 days whose drones did not come. From "
            "the second on each raises the score by 5 %, by 25 % at most.",
        ),
    ] = 0
    is_held: Annotated[
        bool, Field(description="Whether its drones and pads are held until the quote expires.")
    ] = False


class QuoteAnswer(WireModel):
    """One offer per provider, the best first, and why other providers make no offer."""

    offers: Annotated[
        tuple[OfferTerms, ...], Field(description="One offer of each provider, the best first.")
    ]
    infeasible: Annotated[
        tuple[ProviderReason, ...], Field(description="Why the other providers make none.")
    ]
    held_until_at: Annotated[
        datetime | None,
        Field(description="Until when offers are held, wall time; null if none is held."),
    ] = None


class KeepOffer(WireModel):
    """The body of POST /internal/offers: keep an offer that a customer accepts now.

    `offer.hold` names the hold of an offer that was held with its quote.
    """

    hold_id: Annotated[
        HoldId,
        Field(description="Id for the hold of an offer that was not held; the same in each call."),
    ]
    customer_id: Annotated[SubjectId, Field(description="The customer who accepts the offer.")]
    request: Annotated[DeliveryRequest, Field(description="The request of the quote.")]
    shortlist: Annotated[Shortlist, Field(description="The drones of the provider.")]
    offer: Annotated[OfferLimits, Field(description="What the offer promised.")]

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones to compare."""
        return self.shortlist.candidates


class KeptOffer(WireModel):
    """The hold that keeps the offer until it is booked; or null, and why it is lost."""

    hold: Annotated[
        OfferHold | None, Field(description="What is held; null if the offer cannot be kept.")
    ]
    reasons: Annotated[
        tuple[ProviderReason, ...], Field(description="Why the offer cannot be kept.")
    ] = ()

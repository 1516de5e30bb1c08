"""Gateway and composition about offers that are held: for a quote, or to be accepted."""

from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.mission import OfferHold, OfferLimits
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest
from skyway.ids import HoldId, SubjectId
from skyway.json_model import WireModel

#: Wall seconds for which composition holds an offer longer than the customer is told, so that an
#: offer that is accepted at its last moment is still held when composition is asked to keep it.
HOLD_GRACE_S: Final = 5.0

#: Why a booking did not use the drones and pads that were held for its offer.
HoldLoss = Literal[
    "EXPIRED", "NETWORK_CHANGED", "CALENDAR_CHANGED", "DRONE_NOT_FREE", "REQUEST_CHANGED"
]


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
    """The hold that keeps the offer until it is booked; or null, and why it cannot be kept."""

    hold: Annotated[
        OfferHold | None, Field(description="What is held; null if the offer cannot be kept.")
    ]
    reasons: Annotated[
        tuple[ProviderReason, ...], Field(description="Why the offer cannot be kept.")
    ] = ()

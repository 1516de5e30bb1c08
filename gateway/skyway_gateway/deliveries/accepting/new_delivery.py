"""What a customer may send to get a delivery, and the delivery that it becomes."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.mission import OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, OfferId, QuoteId, SubjectId
from skyway.json_model import JsonModel
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, Flags, PackageStatus


class OfferChoice(JsonModel):
    """An offer of a quote that the customer accepts; the quote holds the request."""

    quote_id: Annotated[QuoteId, Field(description="The quote that holds the offer.")]
    offer_id: Annotated[OfferId, Field(description="The offer to accept.")]


def new_delivery(
    delivery_id: DeliveryId,
    *,
    customer_id: SubjectId,
    request: DeliveryRequest,
    offer: OfferLimits | None,
    reasons: tuple[ProviderReason, ...] = (),
    at: datetime,
) -> Delivery:
    """The delivery of a request that was just accepted: its packages are at the pickup."""
    pickup = Custodian(kind="STATION", id=request.pickup.station_id)
    return Delivery(
        delivery_id=delivery_id,
        customer_id=customer_id,
        state="REQUESTED",
        activity=None,
        flags=Flags(),
        reference=request.reference,
        request=request,
        created_at=at,
        updated_at=at,
        attempt=1,
        price=None,
        provider_id=None,
        missions=(),
        packages=tuple(
            PackageStatus(
                package_id=package.package_id,
                state="CREATED",
                destination=package.destination,
                mass_kg=package.mass_kg,
                custodian=pickup,
            )
            for package in request.packages
        ),
        refusals=(),
        reasons=reasons,
        offer=offer,
    )

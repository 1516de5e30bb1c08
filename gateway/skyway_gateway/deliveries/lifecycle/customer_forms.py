"""What customers send and see: requests, accepted offers, and deliveries without ways home."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.delivery.request import MAX_PACKAGES
from skyway.ids import OfferId, QuoteId
from skyway.runtime.http.identity import Caller
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.lifecycle.package_changes import with_p90
from skyway_gateway.personal_data.details import DeliveryDetails, HandOverDetails, PackageDetails
from skyway_gateway.personal_data.store import StoredPersonalData
from skyway_gateway.places.customer_request import CustomerPackage, CustomerRequest
from skyway_gateway.places.served import ServedPlace
from skyway_gateway.proofs.verification import CustomerVerification, DropoffProof


def shown_to(caller: Caller, delivery: Delivery) -> Delivery:
    """The delivery for this caller, with the P90 of each ETA.

    Operators see all of it. Customers see no ways home of drones and no counters of planners.
    """
    delivery = with_p90(delivery)
    if caller.role != "customer" or not delivery.missions:
        return delivery
    missions = tuple(_without_the_way_home(mission) for mission in delivery.missions)
    return delivery.model_copy(update={"missions": missions})


def _without_the_way_home(mission: FlownMission) -> FlownMission:
    return mission.model_copy(
        update={
            "plan": mission.plan.model_copy(update={"stats": {}}),
            "home_plan": None,
            "home_recharge": None,
            "released_at": None,
        }
    )


class NewPackage(PackageDetails, CustomerPackage):
    """What is carried, who takes it, and what to know then; its id is the customer's.

    It may have another recipient and other instructions than the delivery.
    """

    dropoff_verification: Annotated[
        CustomerVerification | None,
        Field(
            exclude_if=lambda value: value is None,
            description="The proof without which it is not handed over; null without one.",
        ),
    ] = None


class NewDelivery(DeliveryDetails, CustomerRequest):
    """What a customer asks for: packages, their destinations, the QoS; and the people."""

    packages: Annotated[
        tuple[NewPackage, ...],
        Field(
            max_length=MAX_PACKAGES,
            json_schema_extra={"minItems": 1},
            description="What is delivered, 1 to 100 packages.",
        ),
    ]


class OfferChoice(DeliveryDetails):
    """An offer of a quote that the customer accepts; the quote holds the request."""

    quote_id: Annotated[QuoteId, Field(description="The quote that holds the offer.")]
    offer_id: Annotated[OfferId, Field(description="The offer to accept.")]
    packages: Annotated[
        tuple[PackageDetails, ...],
        Field(
            max_length=MAX_PACKAGES,
            description="The packages with another recipient or other instructions.",
        ),
    ] = ()


class ShownPackage(HandOverDetails, PackageStatus):
    """A package, where it is, when it is expected, and what it has instead of the delivery's."""

    dropoff_proof: Annotated[
        DropoffProof | None,
        Field(description="The proof without which it is not handed over; null without one."),
    ] = None


class ShownDelivery(DeliveryDetails, Delivery):
    """One delivery, with the personal data that its customer gave."""

    packages: Annotated[
        tuple[ShownPackage, ...], Field(description="The packages in the order of the request.")
    ]
    places: Annotated[
        tuple[ServedPlace, ...],
        Field(description="The places that were requested other than by `station_id`."),
    ] = ()
    personal_data_erased_at: Annotated[
        FleetMoment | None,
        Field(description="When the personal data was erased; null if it was not."),
    ] = None

    @classmethod
    def of(
        cls,
        delivery: Delivery,
        stored: StoredPersonalData,
        proofs: Mapping[str, DropoffProof],
    ) -> "ShownDelivery":
        """The delivery with its personal data and the proofs of its packages."""
        own = {each.package_id: dict(each) for each in stored.data.packages}
        packages = tuple(
            ShownPackage.model_construct(
                **dict(each) | own.get(each.package_id, {}),
                dropoff_proof=proofs.get(each.package_id),
            )
            for each in delivery.packages
        )
        given = {name: getattr(stored.data, name) for name in DeliveryDetails.model_fields}
        return cls.model_construct(
            **dict(delivery) | given | {"packages": packages, "places": stored.data.places},
            personal_data_erased_at=stored.erased_at,
        )


class RequestedDelivery(Delivery):
    """A delivery that was just requested, with the link to its tracking page."""

    tracking_url: Annotated[
        str | None,
        Field(
            description="Link to the tracking page, for everybody who may follow the delivery "
            "without a key. Null for a browser's session, because the link outlives the session."
        ),
    ]

"""A delivery as its customer sees it: the life of one request."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import LIVE_MISSION_STATES, Mission, OfferLimits
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest, Place
from skyway.geo import Position
from skyway.ids import (
    DeliveryId,
    DroneId,
    MissionId,
    PackageId,
    ProviderId,
    StationId,
    SubjectId,
)
from skyway.json_model import JsonModel
from skyway_gateway.deliveries.lifecycle.proof import Proof
from skyway_gateway.deliveries.lifecycle.states import (
    SETTLED_PACKAGE_STATES,
    TERMINAL_STATES,
    DeliveryState,
    PackageState,
)

Activity = Literal["FLYING", "WAITING", "RECHARGING", "DELIVERING", "OUT_OF_CONTACT"]


class PackageStatus(JsonModel):
    """A package, where it is, and when it is expected."""

    package_id: Annotated[PackageId, Field(description="The customer's id of the package.")]
    state: Annotated[PackageState, Field(description="Where the package is in its life.")]
    destination: Annotated[Place, Field(description="Where the package is handed over.")]
    mass_kg: Annotated[float, Field(description="Mass, kilograms.")]
    custodian: Annotated[Custodian, Field(description="Who holds the package now.")]
    mission_id: Annotated[
        MissionId | None,
        Field(description="The mission that carries the package; null while it waits for one."),
    ] = None
    promised_at: Annotated[
        FleetMoment | None, Field(description="The first ETA that the customer was given.")
    ] = None
    eta_at: Annotated[
        FleetMoment | None,
        Field(
            description="When the package is expected now; null when it does not arrive any more."
        ),
    ] = None
    delivered_at: Annotated[
        FleetMoment | None, Field(description="When the package was handed to its recipient.")
    ] = None
    code: Annotated[
        str | None, Field(description="Why the package is not delivered, for programs.")
    ] = None
    detail: Annotated[
        str | None, Field(description="Why the package is not delivered, in words.")
    ] = None
    proof: Annotated[Proof | None, Field(description="What its hand-over left behind.")] = None
    position: Annotated[
        Position | None,
        Field(description="Longitude and latitude, degrees, if a drone went down with it."),
    ] = None

    @property
    def is_waiting(self) -> bool:
        """Whether the package waits for a mission."""
        return self.state == "CREATED" and self.mission_id is None

    @property
    def is_settled(self) -> bool:
        """Whether nothing will happen to the package any more."""
        return self.state in SETTLED_PACKAGE_STATES


class Flags(JsonModel):
    """What may worry the customer now."""

    delayed: Annotated[bool, Field(description="A package is expected later than promised.")] = (
        False
    )
    replanning: Annotated[
        bool, Field(description="A plan no longer holds and there is no new plan yet.")
    ] = False


class Refusal(JsonModel):
    """A drone that refused to fly the delivery, and why."""

    attempt: Annotated[int, Field(description="The booking attempt of the refused mission.")]
    provider_id: Annotated[ProviderId, Field(description="The provider of the drone.")]
    drone_id: Annotated[DroneId, Field(description="The drone, which is not asked again.")]
    code: Annotated[str | None, Field(description="Why the drone refused, for programs.")]
    detail: Annotated[str | None, Field(description="Why the drone refused, in words.")]


class FlownMission(Mission):
    """A mission as its customer sees it."""

    is_replanning: Annotated[
        bool, Field(description="Whether its plan no longer holds and there is no new plan yet.")
    ] = False
    booked_start_at: Annotated[
        FleetMoment | None,
        Field(description="The start as it was first booked; later plans start later."),
    ] = None

    @property
    def begins_at(self) -> datetime:
        """The start as it was first booked; promised times count from there."""
        return self.booked_start_at or self.start_at

    @property
    def is_live(self) -> bool:
        """Whether its drone still flies the mission."""
        return self.state in LIVE_MISSION_STATES


class Delivery(JsonModel):
    """One delivery, from the request to its end.

    All bookings of a delivery keep the limits of its accepted `offer` together.
    """

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    customer_id: Annotated[SubjectId, Field(description="The customer who requested it.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    activity: Annotated[
        Activity | None,
        Field(description="What the drone does now; null before the start and after the end."),
    ]
    flags: Annotated[Flags, Field(description="What may worry the customer now.")]
    reference: Annotated[str | None, Field(description="The customer's own reference.")]
    request: Annotated[DeliveryRequest, Field(description="What was requested.")]
    created_at: FleetMoment
    updated_at: FleetMoment
    attempt: Annotated[
        int,
        Field(
            ge=1,
            description="Counts booking attempts: refused or left-over packages need another one.",
        ),
    ]
    price: Annotated[
        Price | None,
        Field(description="The price of all its missions together; null before it is planned."),
    ]
    provider_id: Annotated[
        ProviderId | None,
        Field(description="The provider of the first mission; null before it is planned."),
    ]
    missions: Annotated[
        tuple[FlownMission, ...],
        Field(description="The missions that fly it, without refused ones."),
    ]
    packages: Annotated[
        tuple[PackageStatus, ...], Field(description="The packages in the order of the request.")
    ]
    refusals: Annotated[
        tuple[Refusal, ...], Field(description="The drones that refused to fly it.")
    ]
    reasons: Annotated[
        tuple[ProviderReason, ...],
        Field(description="Why the last attempt found no drone, or why it was rejected."),
    ]
    offer: Annotated[
        OfferLimits | None, Field(description="The limits of the accepted offer; null without one.")
    ] = None
    cancel_reason: Annotated[
        str | None,
        Field(description="Why the whole delivery is being cancelled; null when it is not."),
    ] = None

    @property
    def is_over(self) -> bool:
        """Whether the delivery has ended."""
        return self.state in TERMINAL_STATES

    @property
    def waiting(self) -> tuple[PackageStatus, ...]:
        """The packages that wait for a mission."""
        return tuple(package for package in self.packages if package.is_waiting)

    @property
    def is_queued(self) -> bool:
        """Whether booking must look at it."""
        return not self.is_over and bool(self.waiting)

    @property
    def live_missions(self) -> tuple[FlownMission, ...]:
        """The missions that drones still fly."""
        return tuple(mission for mission in self.missions if mission.is_live)


class DeliveryPlan(JsonModel):
    """How a delivery is flown; each plan counts seconds from its mission's `start_at`."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    missions: Annotated[
        tuple[FlownMission, ...],
        Field(description="Its missions with their plans; empty before it is planned."),
    ]


class PackageProof(JsonModel):
    """The proof of one package; null members while the package is on its way."""

    package_id: Annotated[PackageId, Field(description="The customer's id of the package.")]
    state: Annotated[PackageState, Field(description="Where the package is in its life.")]
    custodian: Annotated[Custodian, Field(description="Who holds the package now.")]
    station_id: Annotated[
        StationId | None, Field(description="Where it was handed over; null on its way.")
    ] = None
    position: Annotated[
        Position | None,
        Field(description="Where the drone stood: longitude and latitude, degrees."),
    ] = None
    at: Annotated[FleetMoment | None, Field(description="When it was handed over.")] = None
    mission_id: Annotated[MissionId | None, Field(description="The mission that carried it.")] = (
        None
    )
    provider_id: Annotated[ProviderId | None, Field(description="The provider of the drone.")] = (
        None
    )
    drone_id: Annotated[DroneId | None, Field(description="The drone that carried it.")] = None
    soc: Annotated[
        Soc | None, Field(description="The drone's state of charge at the hand-over.")
    ] = None
    mass_kg: Annotated[
        float | None, Field(description="The measured mass of this package, kilograms.")
    ] = None
    load_before_kg: Annotated[
        float | None, Field(description="What the drone carried before the hand-over, kilograms.")
    ] = None
    load_after_kg: Annotated[
        float | None, Field(description="What the drone carried after the hand-over, kilograms.")
    ] = None


class DeliveryProof(JsonModel):
    """The proof of all packages of a delivery."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    packages: Annotated[tuple[PackageProof, ...], Field(description="The proof of each package.")]


class ProviderDelivery(JsonModel):
    """What a provider sees of a delivery that one of its drones flies."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    activity: Annotated[
        Activity | None,
        Field(description="What the drone does now; null before the start and after the end."),
    ]
    pickup: Annotated[Place, Field(description="Where the packages are picked up.")]
    missions: Annotated[
        tuple[FlownMission, ...], Field(description="The missions of the provider's own drones.")
    ]
    packages: Annotated[
        tuple[PackageStatus, ...], Field(description="The packages of the delivery.")
    ]
    created_at: FleetMoment
    updated_at: FleetMoment

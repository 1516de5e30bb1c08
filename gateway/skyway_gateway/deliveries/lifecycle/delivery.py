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

Activity = Literal["FLYING", "WAITING", "RECHARGING", "DELIVERING"]


class PackageStatus(JsonModel):
    """Where a package is in its life; `promised_at` is the first ETA that its customer was told.

    `mission_id` carries it; None while it waits for a mission. `code` and `detail` tell why it is
    not delivered. `proof` is what its hand-over left behind. `position` is where it lies with a
    drone that went down away from every station.
    """

    package_id: PackageId
    state: PackageState
    destination: Place
    mass_kg: float
    custodian: Custodian
    mission_id: MissionId | None = None
    promised_at: FleetMoment | None = None
    eta_at: FleetMoment | None = None
    delivered_at: FleetMoment | None = None
    code: str | None = None
    detail: str | None = None
    proof: Proof | None = None
    position: Position | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether a mission is still to be booked for it."""
        return self.state == "CREATED" and self.mission_id is None

    @property
    def is_settled(self) -> bool:
        """Whether nothing will ever happen to it again."""
        return self.state in SETTLED_PACKAGE_STATES


class Flags(JsonModel):
    """What a customer may worry about while it lasts."""

    delayed: bool = False
    replanning: bool = False


class Refusal(JsonModel):
    """A drone that would not fly the delivery; it is not asked again."""

    attempt: int
    provider_id: ProviderId
    drone_id: DroneId
    code: str | None
    detail: str | None


class FlownMission(Mission):
    """A mission as its customer sees it; `is_replanning` while its plan does not hold.

    `booked_start_at` is the start that was booked first: each new plan has a later one.
    """

    is_replanning: bool = False
    booked_start_at: FleetMoment | None = None

    @property
    def begins_at(self) -> datetime:
        """When it was first to begin; what it promised counts from there."""
        return self.booked_start_at or self.start_at

    @property
    def is_live(self) -> bool:
        """Whether its drone is still on it."""
        return self.state in LIVE_MISSION_STATES


class Delivery(JsonModel):
    """One delivery, from request to end.

    `attempt` counts bookings: packages whose mission was refused, or that the last booking left
    over, are booked by another one. `offer` is what was promised when an offer was taken; all else
    is booked within it. `reasons` tell why no drone was found at the last try, and why a delivery
    was rejected; `cancel_reason` why all that can still be stopped is to be.
    """

    delivery_id: DeliveryId
    customer_id: SubjectId
    state: DeliveryState
    activity: Activity | None
    flags: Flags
    reference: str | None
    request: DeliveryRequest
    created_at: FleetMoment
    updated_at: FleetMoment
    attempt: Annotated[int, Field(ge=1)]
    price: Price | None
    provider_id: ProviderId | None
    missions: tuple[FlownMission, ...]
    packages: tuple[PackageStatus, ...]
    refusals: tuple[Refusal, ...]
    reasons: tuple[ProviderReason, ...]
    offer: OfferLimits | None = None
    cancel_reason: str | None = None

    @property
    def is_over(self) -> bool:
        """Whether nothing will ever change again."""
        return self.state in TERMINAL_STATES

    @property
    def waiting(self) -> tuple[PackageStatus, ...]:
        """The packages for which a mission is to be booked."""
        return tuple(package for package in self.packages if package.is_waiting)

    @property
    def is_queued(self) -> bool:
        """Whether `book` is to look at it."""
        return not self.is_over and bool(self.waiting)

    @property
    def live_missions(self) -> tuple[FlownMission, ...]:
        """The missions whose drones are still on them."""
        return tuple(mission for mission in self.missions if mission.is_live)


class DeliveryPlan(JsonModel):
    """How a delivery is flown: each mission's plan counts seconds from its `start_at`."""

    delivery_id: DeliveryId
    state: DeliveryState
    missions: tuple[FlownMission, ...]


class PackageProof(JsonModel):
    """What proves where a package ended: the members of its proof, null while it is on its way."""

    package_id: PackageId
    state: PackageState
    custodian: Custodian
    station_id: StationId | None = None
    position: Position | None = None
    at: FleetMoment | None = None
    mission_id: MissionId | None = None
    provider_id: ProviderId | None = None
    drone_id: DroneId | None = None
    soc: Soc | None = None
    mass_kg: float | None = None
    load_before_kg: float | None = None
    load_after_kg: float | None = None


class DeliveryProof(JsonModel):
    """Package by package: place, time, weights before and after, and whose drone it was."""

    delivery_id: DeliveryId
    state: DeliveryState
    packages: tuple[PackageProof, ...]


class ProviderDelivery(JsonModel):
    """What a provider sees of a delivery that one of its drones flies."""

    delivery_id: DeliveryId
    state: DeliveryState
    activity: Activity | None
    pickup: Place
    missions: tuple[FlownMission, ...]
    packages: tuple[PackageStatus, ...]
    created_at: FleetMoment
    updated_at: FleetMoment

"""A delivery as its customer sees it: the life of one request."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import Mission
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest, Place
from skyway.ids import DeliveryId, DroneId, PackageId, ProviderId, SubjectId
from skyway.json_model import JsonModel
from skyway_gateway.deliveries.states import TERMINAL_STATES, DeliveryState, PackageState

Activity = Literal["FLYING", "WAITING", "RECHARGING", "DELIVERING"]


class Custodian(JsonModel):
    """Who holds a package: a station, a drone, or the recipient at a station."""

    kind: Literal["STATION", "DRONE", "RECIPIENT"]
    id: str


class PackageStatus(JsonModel):
    """Where a package is in its life; `promised_at` is the first ETA that its customer was told."""

    package_id: PackageId
    state: PackageState
    destination: Place
    mass_kg: float
    custodian: Custodian
    promised_at: FleetMoment | None = None
    eta_at: FleetMoment | None = None
    delivered_at: FleetMoment | None = None


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


class Delivery(JsonModel):
    """One delivery, from request to end.

    `attempt` counts bookings: a refused mission is booked anew without that drone. `reasons` tell
    why no drone was found at the last try, and why a delivery was rejected.
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
    missions: tuple[Mission, ...]
    packages: tuple[PackageStatus, ...]
    refusals: tuple[Refusal, ...]
    reasons: tuple[ProviderReason, ...]

    @property
    def is_over(self) -> bool:
        """Whether nothing will ever change again."""
        return self.state in TERMINAL_STATES


class DeliveryPlan(JsonModel):
    """How a delivery is flown: each mission's plan counts seconds from its `start_at`."""

    delivery_id: DeliveryId
    state: DeliveryState
    missions: tuple[Mission, ...]


class ProviderDelivery(JsonModel):
    """What a provider sees of a delivery that one of its drones flies."""

    delivery_id: DeliveryId
    state: DeliveryState
    activity: Activity | None
    pickup: Place
    missions: tuple[Mission, ...]
    packages: tuple[PackageStatus, ...]
    created_at: FleetMoment
    updated_at: FleetMoment

"""A delivery as its customer sees it: the life of one request, and its states in order."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Final, Literal

from pydantic import Field, computed_field

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import OfferLimits
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
    is_live_id,
)
from skyway.json_model import JsonModel, WireModel
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission, Refusal, Waiting

DeliveryState = Literal[
    "SCHEDULED",
    "REQUESTED",
    "PLANNED",
    "DISPATCHED",
    "LOADING",
    "IN_PROGRESS",
    "COMPLETED",
    "PARTIALLY_COMPLETED",
    "CANCELLED",
    "FAILED",
    "REJECTED",
]

PackageState = Literal[
    "CREATED",
    "LOADED",
    "IN_TRANSIT",
    "DELIVERED",
    "RETURNING",
    "RETURNED",
    "STRANDED",
    "CANCELLED",
]

_ENDS: Final[frozenset[DeliveryState]] = frozenset(
    {"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED"}
)

TERMINAL_STATES: Final[frozenset[DeliveryState]] = _ENDS | {"REJECTED"}

#: A delivery in these states has, or had, a mission.
UNDER_WAY_STATES: Final[frozenset[DeliveryState]] = frozenset(
    {"PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS"}
)

#: A delivery is over when all its packages are in these states.
SETTLED_PACKAGE_STATES: Final[frozenset[PackageState]] = frozenset(
    {"DELIVERED", "RETURNED", "STRANDED", "CANCELLED"}
)

#: A package in these states is on a drone.
ON_BOARD_STATES: Final[frozenset[PackageState]] = frozenset({"LOADED", "IN_TRANSIT", "RETURNING"})

#: Which states may follow each state. A report may skip states, such as LOADING when the drone
#: loads within one report. A request is REJECTED when none of its packages is ever booked.
_NEXT: Final[Mapping[DeliveryState, frozenset[DeliveryState]]] = {
    # A delivery is SCHEDULED while its pickup lies beyond the booking horizon.
    "SCHEDULED": frozenset({"REQUESTED", "CANCELLED", "FAILED"}),
    # It is SCHEDULED again if its customer postpones it.
    "REQUESTED": frozenset({"SCHEDULED", "PLANNED", "REJECTED", "CANCELLED", "FAILED"}),
    "PLANNED": _ENDS | {"SCHEDULED", "REQUESTED", "DISPATCHED", "LOADING", "IN_PROGRESS"},
    # A delivery goes back when a drone refuses the mission that was furthest along.
    "DISPATCHED": _ENDS | {"REQUESTED", "PLANNED", "LOADING", "IN_PROGRESS"},
    "LOADING": _ENDS | {"IN_PROGRESS"},
    "IN_PROGRESS": _ENDS,
}

Activity = Literal["FLYING", "WAITING", "RECHARGING", "DELIVERING", "OUT_OF_CONTACT"]


class Proof(WireModel):
    """What a drone reported when it handed a package over, to a recipient or back to a station.

    One hand-over may concern several packages: the loads are of all, `mass_kg` is of this package.
    """

    station_id: Annotated[
        StationId | None,
        Field(description="Where the package was handed over; null away from every station."),
    ]
    position: Annotated[
        Position | None,
        Field(description="Where the drone stood: longitude and latitude, degrees."),
    ] = None
    at: FleetMoment
    mission_id: Annotated[MissionId, Field(description="The mission that carried it.")]
    provider_id: Annotated[ProviderId, Field(description="The provider of the drone.")]
    drone_id: Annotated[DroneId, Field(description="The drone that carried it.")]
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


class ProofWait(WireModel):
    """How long a drone waits with a package for the proof of its hand-over."""

    since_at: FleetMoment
    until_at: FleetMoment


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
        FleetMoment | None,
        Field(description="When the plan of its last booking delivers it (P50); null before that."),
    ] = None
    promised_p90_at: Annotated[
        FleetMoment | None,
        Field(
            description="The moment by which nine of ten such packages come (P90), known at "
            "the booking; null before enough packages of the network have come."
        ),
    ] = None
    due_at: Annotated[
        FleetMoment | None,
        Field(
            description="The promise from which lateness counts: `promised_p90_at`, or "
            "`promised_at` if the request's `qos.promise` is P50 or no P90 was known, later "
            "by `qos.may_be_later_s`, or the end of the package's window."
        ),
    ] = None
    eta_at: Annotated[
        FleetMoment | None,
        Field(
            description="When the package is expected now; null when it does not arrive any more."
        ),
    ] = None
    eta_p90_at: Annotated[
        FleetMoment | None,
        Field(
            description="The moment by which it comes in nine of ten cases (P90), as known now; "
            "null without `eta_at` or `promised_p90_at`."
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
    proof_wait: Annotated[
        ProofWait | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Since when and until when a drone waits, or has waited, for the proof of "
            "its hand-over.",
        ),
    ] = None
    position: Annotated[
        Position | None,
        Field(description="Longitude and latitude, degrees, if a drone went down with it."),
    ] = None

    @property
    def is_waiting(self) -> bool:
        """Whether the package waits for a mission."""
        return self.state == "CREATED" and self.mission_id is None

    def awaits_proof(self, now: datetime) -> bool:
        """Whether a drone waits for the proof of its hand-over at this moment of fleet time."""
        wait = self.proof_wait
        is_there = self.state in ("LOADED", "IN_TRANSIT")
        return is_there and wait is not None and now <= wait.until_at

    @property
    def is_settled(self) -> bool:
        """Whether nothing will happen to the package any more."""
        return self.state in SETTLED_PACKAGE_STATES


class Promise(JsonModel):
    """Whether `promised_at` and `due_at` of the packages may still change."""

    state: Annotated[
        Literal["PROVISIONAL", "FIRM"],
        Field(description="PROVISIONAL: the promise becomes firm with `delivery.promised`."),
    ]
    firm_at: Annotated[
        FleetMoment | None,
        Field(description="When it becomes firm at the latest; null once it is firm."),
    ]


class Flags(JsonModel):
    """What may worry the customer now."""

    delayed: Annotated[bool, Field(description="A package is expected after its `due_at`.")] = False
    replanning: Annotated[
        bool, Field(description="A plan no longer holds and there is no new plan yet.")
    ] = False


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
    waiting: Annotated[
        Waiting | None, Field(description="Its place while no drone is free; null otherwise.")
    ] = None

    @computed_field(  # type: ignore[prop-decorator]
        description="Where the packages are handed over to the drone: the pickup of the request, "
        "or a station that its `qos.pickup_within_m` allows. Once it is booked it stays the same."
    )
    @property
    def pickup(self) -> Place:
        """Where the packages are handed over to the drone.

        Packages that wait for another mission stay where they were to be handed over.
        """
        flown = (mission.pickup_station_id for mission in self.missions)
        kept = (
            one.custodian.id
            for one in self.packages
            if one.state in ("CREATED", "CANCELLED") and one.custodian.kind == "STATION"
        )
        own = self.request.pickup
        other = next((each for each in (*flown, *kept) if each != own.station_id), None)
        return own if other is None else Place(station_id=StationId(other))

    @computed_field(  # type: ignore[prop-decorator]
        description="False for what belongs to a test account."
    )
    @property
    def livemode(self) -> bool:
        """Whether it is real."""
        return is_live_id(self.delivery_id)

    @computed_field(  # type: ignore[prop-decorator]
        exclude_if=lambda value: value is None,
        description="Whether its promise is firm; absent without `qos.firm_within_s`, and before "
        "it is planned.",
    )
    @property
    def promise(self) -> Promise | None:
        """Whether its promise is firm; None without `firm_within_s`, and before it is planned."""
        if self.request.qos.firm_within_s == 0 or not self.missions:
            return None
        moments = [each.firm_at for each in self.live_missions if each.firm_at is not None]
        state: Literal["PROVISIONAL", "FIRM"] = "PROVISIONAL" if moments else "FIRM"
        return Promise(state=state, firm_at=max(moments, default=None))

    @property
    def is_provisional(self) -> bool:
        """Whether a promise of the delivery may still change."""
        return self.promise is not None and self.promise.state == "PROVISIONAL"

    @property
    def is_over(self) -> bool:
        """Whether the delivery has ended."""
        return self.state in TERMINAL_STATES

    @property
    def waiting_packages(self) -> tuple[PackageStatus, ...]:
        """The packages that wait for a mission."""
        return tuple(package for package in self.packages if package.is_waiting)

    @property
    def is_queued(self) -> bool:
        """Whether booking must look at it; not while its pickup is beyond the horizon."""
        return not self.is_over and self.state != "SCHEDULED" and bool(self.waiting_packages)

    @property
    def live_missions(self) -> tuple[FlownMission, ...]:
        """The missions that drones still fly."""
        return tuple(mission for mission in self.missions if mission.is_live)


def may_follow(after: DeliveryState, before: DeliveryState) -> bool:
    """Whether a delivery in state `before` may change to state `after`, or stay in it."""
    return after == before or after in _NEXT.get(before, ())

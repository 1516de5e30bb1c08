"""Gateway and composition about missions: booking them, and reporting how they go."""

from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Price
from skyway.delivery.plan import Plan, Recharge
from skyway.delivery.request import DeliveryRequest
from skyway.geo import Position
from skyway.ids import (
    DeliveryId,
    DroneId,
    DroneModelId,
    MissionId,
    PackageId,
    ProviderId,
    StationId,
)
from skyway.json_model import WireModel

MissionState = Literal[
    "BOOKED", "ACCEPTED", "ACTIVE", "COMPLETED", "ABORTED", "CANCELLED", "REFUSED"
]

#: A drone is on at most one mission in these states, and pads are reserved for it.
LIVE_MISSION_STATES: tuple[MissionState, ...] = ("BOOKED", "ACCEPTED", "ACTIVE")


class PackageEta(WireModel):
    """When a package is planned to be delivered."""

    package_id: PackageId
    eta_at: FleetMoment


class Margins(WireModel):
    """What a plan was booked with on top of what it needs: a share of energy, time between drones.

    The plan's energies hold `energy_margin` already; each pad is reserved `pad_gap_s` longer than
    its session. A drone later than `tolerated_lateness_s` gets a new plan if that loses something.
    """

    energy_margin: Annotated[float, Field(ge=0)] = 0.0
    pad_gap_s: Annotated[float, Field(ge=0)] = 0.0
    tolerated_lateness_s: Annotated[float, Field(ge=0)] = 0.0


class Mission(WireModel):
    """A plan being flown: what a delivery shows of it, and what operators see.

    `plan` ends with the last delivery and counts seconds from `start_at`; `home_plan` takes the
    empty drone home from there, and `home_recharge` charges it there to the top, both counting from
    the end of `plan`; `released_at` is when the drone is planned to be free again. All of these are
    of the present revision: after a re-composition `plan` holds only what was left to deliver then.
    """

    mission_id: MissionId
    delivery_id: DeliveryId
    attempt: Annotated[int, Field(ge=1)]
    trip: Annotated[int, Field(ge=1)] = 1
    provider_id: ProviderId
    drone_id: DroneId
    drone_model_id: DroneModelId
    state: MissionState
    revision: Annotated[int, Field(ge=1)]
    start_at: FleetMoment
    released_at: FleetMoment
    price: Price
    packages: tuple[PackageEta, ...]
    plan: Plan
    home_plan: Plan | None = None
    home_recharge: Recharge | None = None
    margins: Margins = Margins()
    #: AWAITED while the drone stands at the pickup until a loader confirms.
    loading: Literal["AUTOMATIC", "CONFIRMED", "AWAITED"] = "AUTOMATIC"
    is_held: bool = False
    #: Why the plan does not deliver what is on board, but leaves it where the drone can land.
    given_up: str | None = None


class OfferLimits(WireModel):
    """What an offer that was taken has promised; a booking keeps it, or there is none.

    `within_s` counts from the mission's start to the last delivery.
    """

    provider_id: ProviderId
    price: Price
    within_s: Annotated[float, Field(ge=0)]


class BookMissions(WireModel):
    """The body of PUT /internal/deliveries/{delivery_id}/missions, keyed by (delivery, attempt).

    Candidates are compared by their true plans. `request` holds the packages to plan for only.
    """

    attempt: Annotated[int, Field(ge=1)]
    request: DeliveryRequest
    shortlist: Shortlist
    offer: OfferLimits | None = None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones to compare."""
        return self.shortlist.candidates


class Booking(WireModel):
    """BOOKED with its missions, BUSY (ask again later), INFEASIBLE (never), CLOSED (tombstone).

    The packages that the missions of BOOKED do not carry are to be booked by a later attempt; with
    a price limit or an offer all are booked or none.
    """

    outcome: Literal["BOOKED", "BUSY", "INFEASIBLE", "CLOSED"]
    missions: tuple[Mission, ...] = ()
    reasons: tuple[ProviderReason, ...] = ()


class ClosedDelivery(WireModel):
    """The answer to PUT /internal/deliveries/{delivery_id}/closed.

    Once closed nothing is booked for the delivery; missions that were booked before are named,
    and then the delivery is not closed.
    """

    is_closed: bool
    missions: tuple[Mission, ...] = ()


class CancelMissions(WireModel):
    """The body of POST /internal/deliveries/{delivery_id}/cancellations; all when no packages.

    The same `cancellation_id` again is answered the same.
    """

    cancellation_id: str
    package_ids: tuple[PackageId, ...] | None = None
    reason: str


class Cancellation(WireModel):
    """What a cancellation leads to, package by package; mission reports tell when it has.

    `released` stay at the pickup: their missions end, or go on without them, at once.
    `returning` are on board, and come back to the pickup or strand where a drone can land.
    `too_late` are with their recipients, or are over.
    """

    released: tuple[PackageId, ...] = ()
    returning: tuple[PackageId, ...] = ()
    too_late: tuple[PackageId, ...] = ()


class MissionReport(WireModel):
    """Composition to gateway and registry: one thing that happened to a mission.

    `seq` counts per mission from 1 without gaps; the sender repeats until answered 2xx. Kinds:

    ACCEPTED    the drone will fly it
    REFUSED     it will not (code); the mission is over and everything is freed
    LOADING     the mission has begun: approach flight, or loading at the pickup
    LOADED      the packages are on board
    ACTIVITY    `activity`, `station_id` and `soc` changed
    DELIVERED   `package_ids` were handed over
    REPLANNING  the plan does not hold any more (`code`), another is looked for
    REPLANNED   the drone has taken a new revision of the plan (`mission` holds it)
    RETURNING   `package_ids` go back to the pickup instead of being delivered (`code`)
    RETURNED    `package_ids` were handed back at `station_id`
    RELEASED    `package_ids` will not be loaded any more: they were cancelled at the pickup
    ENDED       the mission is over: COMPLETED, ABORTED or CANCELLED; packages that were not
                delivered are `stranded_package_ids` at `station_id`, or never left the pickup;
                where the drone went down away from every station, they are with it at `position`
    """

    report_id: str
    delivery_id: DeliveryId
    attempt: int
    trip: int
    mission_id: MissionId
    provider_id: ProviderId
    drone_id: DroneId
    seq: Annotated[int, Field(ge=1)]
    kind: Literal[
        "ACCEPTED",
        "REFUSED",
        "LOADING",
        "LOADED",
        "ACTIVITY",
        "DELIVERED",
        "REPLANNING",
        "REPLANNED",
        "RETURNING",
        "RETURNED",
        "RELEASED",
        "ENDED",
    ]
    at: FleetMoment
    mission_state: MissionState
    activity: Literal["FLYING", "WAITING", "RECHARGING", "DELIVERING"] | None = None
    station_id: StationId | None = None
    position: Position | None = None
    soc: Soc | None = None
    package_ids: tuple[PackageId, ...] = ()
    stranded_package_ids: tuple[PackageId, ...] = ()
    etas: tuple[PackageEta, ...] = ()
    mission: Mission | None = None
    code: str | None = None
    detail: str | None = None
    #: Evidence and numbers: place and weights at a hand-over, flown seconds and joules at the end.
    data: dict[str, Any] = Field(default_factory=dict)

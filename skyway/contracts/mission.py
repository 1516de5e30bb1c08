"""Gateway and composition about missions: booking them, and reporting how they go."""

from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.doubt import Doubt
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

    energy_margin: Annotated[
        float, Field(ge=0, description="Energy on top of what flights need, as a share.")
    ] = 0.0
    pad_gap_s: Annotated[float, Field(ge=0, description="Seconds between two drones on a pad.")] = (
        0.0
    )
    tolerated_lateness_s: Annotated[
        float,
        Field(ge=0, description="Seconds that a drone may be late before it gets a new plan."),
    ] = 0.0


class Mission(WireModel):
    """A plan being flown: what a delivery shows of it, and what operators see.

    `plan` ends with the last delivery and counts seconds from `start_at`; `home_plan` takes the
    empty drone home from there, and `home_recharge` charges it there to the top, both counting from
    the end of `plan`; `released_at` is when the drone is planned to be free again. All of these are
    of the present revision: after a re-composition `plan` holds only what was left to deliver then.
    """

    mission_id: MissionId
    delivery_id: DeliveryId
    attempt: Annotated[
        int, Field(ge=1, description="The number of the booking that made the mission, from 1.")
    ]
    trip: Annotated[
        int, Field(ge=1, description="The number of the trip within its booking, from 1.")
    ] = 1
    provider_id: ProviderId
    drone_id: DroneId
    drone_model_id: DroneModelId
    state: Annotated[MissionState, Field(description="The state of the mission.")]
    revision: Annotated[int, Field(ge=1, description="The number of the present plan, from 1.")]
    start_at: FleetMoment
    released_at: FleetMoment
    price: Annotated[Price, Field(description="What the mission costs.")]
    packages: Annotated[
        tuple[PackageEta, ...], Field(description="The packages that it delivers, and when.")
    ]
    plan: Annotated[Plan, Field(description="The present plan, up to the last delivery.")]
    home_plan: Annotated[
        Plan | None,
        Field(description="How the empty drone flies home; seconds count from the end of `plan`."),
    ] = None
    home_recharge: Annotated[
        Recharge | None,
        Field(
            description="How the drone is charged at home; seconds count from the end of `plan`."
        ),
    ] = None
    margins: Annotated[
        Margins, Field(description="What the plan was booked with on top of what it needs.")
    ] = Margins()
    #: AWAITED while the drone stands at the pickup until a loader confirms.
    loading: Annotated[
        Literal["AUTOMATIC", "CONFIRMED", "AWAITED"],
        Field(description="AWAITED while the drone stands at the pickup until a loader confirms."),
    ] = "AUTOMATIC"
    is_held: Annotated[bool, Field(description="Whether an operator holds the drone.")] = False
    #: Why the plan does not deliver what is on board, but leaves it where the drone can land.
    given_up: Annotated[
        str | None, Field(description="Why the plan delivers nothing; null if it delivers.")
    ] = None
    doubt: Annotated[
        Doubt | None,
        Field(description="Why the mission waits for its drone or an operator; null if it is not."),
    ] = None


class OfferLimits(WireModel):
    """What an offer that was taken has promised; a booking keeps it, or there is none.

    `within_s` counts from the mission's start to the last delivery.
    """

    provider_id: ProviderId
    price: Annotated[Price, Field(description="The price that was promised.")]
    within_s: Annotated[
        float,
        Field(ge=0, description="Seconds from the start of the mission to the last delivery."),
    ]


class BookMissions(WireModel):
    """The body of PUT /internal/deliveries/{delivery_id}/missions, keyed by (delivery, attempt).

    Candidates are compared by their true plans. `request` holds the packages to plan for only.
    """

    attempt: Annotated[int, Field(ge=1, description="The number of this booking, from 1.")]
    request: Annotated[DeliveryRequest, Field(description="The packages to book, and their QoS.")]
    shortlist: Annotated[Shortlist, Field(description="The drones to compare.")]
    offer: Annotated[
        OfferLimits | None, Field(description="What an accepted offer promised; null without one.")
    ] = None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones to compare."""
        return self.shortlist.candidates


class Booking(WireModel):
    """BOOKED with its missions, BUSY (ask again later), INFEASIBLE (never), CLOSED (tombstone).

    The packages that the missions of BOOKED do not carry are to be booked by a later attempt; with
    a price limit or an offer all are booked or none.
    """

    outcome: Annotated[
        Literal["BOOKED", "BUSY", "INFEASIBLE", "CLOSED"],
        Field(description="BOOKED, BUSY (ask again later), INFEASIBLE (never) or CLOSED."),
    ]
    missions: Annotated[
        tuple[Mission, ...], Field(description="The missions that were booked.")
    ] = ()
    reasons: Annotated[
        tuple[ProviderReason, ...], Field(description="Why each provider cannot fly it.")
    ] = ()


class ClosedDelivery(WireModel):
    """The answer to PUT /internal/deliveries/{delivery_id}/closed.

    Once closed nothing is booked for the delivery; missions that were booked before are named,
    and then the delivery is not closed.
    """

    is_closed: Annotated[bool, Field(description="Whether nothing will be booked any more.")]
    missions: Annotated[
        tuple[Mission, ...], Field(description="Missions that were booked before.")
    ] = ()


class CancelMissions(WireModel):
    """The body of POST /internal/deliveries/{delivery_id}/cancellations; all when no packages.

    The same `cancellation_id` again is answered the same.
    """

    cancellation_id: Annotated[
        str, Field(description="Id of the call; the same id is answered the same.")
    ]
    package_ids: Annotated[
        tuple[PackageId, ...] | None,
        Field(description="The packages to cancel; all of them if null."),
    ] = None
    reason: Annotated[str, Field(description="Why, for people.")]


class Cancellation(WireModel):
    """What a cancellation leads to, package by package; mission reports tell when it has.

    `released` stay at the pickup: their missions end, or go on without them, at once.
    `returning` are on board, and come back to the pickup or strand where a drone can land.
    `too_late` are with their recipients, or are over.
    """

    released: Annotated[
        tuple[PackageId, ...], Field(description="Packages that stay at the pickup.")
    ] = ()
    returning: Annotated[
        tuple[PackageId, ...], Field(description="Packages that are on board and come back.")
    ] = ()
    too_late: Annotated[
        tuple[PackageId, ...], Field(description="Packages that can no longer be stopped.")
    ] = ()


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

    report_id: Annotated[str, Field(description="Id of the report.")]
    delivery_id: DeliveryId
    attempt: Annotated[int, Field(description="The number of the booking, from 1.")]
    trip: Annotated[int, Field(description="The number of the trip, from 1.")]
    mission_id: MissionId
    provider_id: ProviderId
    drone_id: DroneId
    seq: Annotated[
        int, Field(ge=1, description="The number of the report within its mission, from 1.")
    ]
    kind: Annotated[
        Literal[
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
        ],
        Field(description="What happened."),
    ]
    at: FleetMoment
    mission_state: Annotated[MissionState, Field(description="The state of the mission now.")]
    activity: Annotated[
        Literal["FLYING", "WAITING", "RECHARGING", "DELIVERING", "OUT_OF_CONTACT"] | None,
        Field(
            description="What the drone does now. OUT_OF_CONTACT: nobody knows; the mission waits "
            "for its drone or an operator."
        ),
    ] = None
    station_id: StationId | None = None
    position: Annotated[Position | None, Field(description="Where the drone is, in degrees.")] = (
        None
    )
    soc: Soc | None = None
    package_ids: Annotated[
        tuple[PackageId, ...], Field(description="The packages that it is about.")
    ] = ()
    stranded_package_ids: Annotated[
        tuple[PackageId, ...], Field(description="The packages that were not delivered.")
    ] = ()
    etas: Annotated[
        tuple[PackageEta, ...], Field(description="When each package is expected.")
    ] = ()
    mission: Annotated[Mission | None, Field(description="The mission with its new plan.")] = None
    code: Annotated[str | None, Field(description="Why, for programs.")] = None
    detail: Annotated[str | None, Field(description="Why, for people.")] = None
    #: Evidence and numbers: place and weights at a hand-over, flown seconds and joules at the end.
    data: dict[str, Any] = Field(
        default_factory=dict,
        description="Evidence: place and masses at a hand-over, seconds and joules at the end.",
    )

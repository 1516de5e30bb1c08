"""Gateway and composition about missions: booking them, cancelling them, and doubt about them."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.margins import Margins
from skyway.contracts.message import FleetMoment
from skyway.contracts.shortlist import Shortlist
from skyway.contracts.weather import WeatherNote
from skyway.delivery.offer import Price, Tariff
from skyway.delivery.payment_terms import PaymentTerms
from skyway.delivery.plan import Plan, Recharge
from skyway.delivery.request import DeliveryRequest
from skyway.ids import (
    DeliveryId,
    DroneId,
    DroneModelId,
    HoldId,
    MissionId,
    PackageId,
    ProviderId,
    StationId,
)
from skyway.json_model import WireModel

MissionState = Literal[
    "QUEUED", "BOOKED", "ACCEPTED", "ACTIVE", "COMPLETED", "ABORTED", "CANCELLED", "REFUSED"
]

#: The mission was sent to its drone and is not over. A drone has at most one such mission.
LIVE_MISSION_STATES: tuple[MissionState, ...] = ("BOOKED", "ACCEPTED", "ACTIVE")

#: The mission is not over, and its pads are reserved. A QUEUED mission waits for the missions
#: before it in its drone's calendar, and is not sent yet.
OPEN_MISSION_STATES: tuple[MissionState, ...] = ("QUEUED", *LIVE_MISSION_STATES)


class Doubt(WireModel):
    """Why it is unknown whether the drone flies, or has flown, its mission.

    The mission keeps its drone, its pads and its packages until the drone reports what happened or
    an operator gives the mission up: no other drone may get the packages meanwhile. Reports of the
    drone do not end the doubt IMPLAUSIBLE: only an operator does.
    """

    code: Annotated[
        Literal["NO_ANSWER", "SILENT", "JOURNAL_LOST", "IMPLAUSIBLE"],
        Field(
            description="NO_ANSWER: the drone did not answer the booking, and may have accepted "
            "it. SILENT: the drone has sent no message since long after the planned end. "
            "JOURNAL_LOST: the drone has lost its journal, and may have handed packages over. "
            "IMPLAUSIBLE: the drone has reported a hand-over that cannot have happened."
        ),
    ]
    detail: Annotated[str, Field(description="The reason as a sentence.")]
    since_at: FleetMoment


class PackageEta(WireModel):
    """When a package is planned to be delivered."""

    package_id: PackageId
    eta_at: FleetMoment


class DeliveryMission(WireModel):
    """A plan being flown, up to its last delivery.

    `plan` ends with the last delivery and counts seconds from `start_at`. Both are of the present
    revision: after replanning, `plan` holds only what was left to deliver.
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
    price: Annotated[Price, Field(description="What the mission costs, as it was booked.")]
    payment_terms: Annotated[
        PaymentTerms,
        Field(description="The terms of its price, as they were when it was booked or offered."),
    ] = PaymentTerms()
    packages: Annotated[
        tuple[PackageEta, ...], Field(description="The packages that it delivers, and when.")
    ]
    plan: Annotated[Plan, Field(description="The present plan, up to the last delivery.")]
    pickup_station_id: Annotated[
        StationId, Field(description="Where the packages are handed over to the drone.")
    ]
    pickup_away_m: Annotated[
        float,
        Field(
            ge=0,
            description="Metres from there to the pickup that this booking asked for; 0 if it is "
            "the same station.",
        ),
    ] = 0.0
    margins: Annotated[
        Margins, Field(description="What the plan was booked with on top of what it needs.")
    ] = Margins()
    weather: Annotated[
        WeatherNote | None,
        Field(description="The forecast or measured wind that the plan uses; null in still air."),
    ] = None
    firm_at: Annotated[
        FleetMoment | None,
        Field(
            exclude_if=lambda value: value is None,
            description="When its promise becomes firm at the latest; absent once it is firm.",
        ),
    ] = None
    #: AWAITED while the drone stands at the pickup until a loader confirms.
    loading: Annotated[
        Literal["AUTOMATIC", "CONFIRMED", "AWAITED"],
        Field(description="AWAITED while the drone stands at the pickup until a loader confirms."),
    ] = "AUTOMATIC"
    is_held: Annotated[bool, Field(description="Whether an operator holds the drone.")] = False
    is_pooled: Annotated[
        bool,
        Field(
            description="Whether the drone has loaded packages of other deliveries too; then "
            "`price` is the pooled price."
        ),
    ] = False
    #: Why the plan does not deliver what is on board, but leaves it where the drone can land.
    given_up: Annotated[
        str | None, Field(description="Why the plan delivers nothing; null if it delivers.")
    ] = None
    doubt: Annotated[
        Doubt | None,
        Field(description="Why the mission waits for its drone or an operator; null if it is not."),
    ] = None


class Mission(DeliveryMission):
    """A plan being flown, with what its drone does after the last delivery.

    `home_plan` and `home_recharge` are the drone's standby, at home or elsewhere: the flight of the
    empty drone to where it stands by, and its recharge there to the top. Both count from the end of
    `plan`. `released_at` is when the drone is planned to be free again.
    """

    released_at: FleetMoment
    home_plan: Annotated[
        Plan | None,
        Field(description="How the drone flies to where it stands by, after the end of `plan`."),
    ] = None
    home_recharge: Annotated[
        Recharge | None,
        Field(description="How it is charged there; seconds count from the end of `plan`."),
    ] = None
    energy_refusals: Annotated[
        int, Field(description="Plans in a row that its drone refused for lack of energy.")
    ] = 0


class OfferHold(WireModel):
    """The drones and pads that composition holds for an offer until it is booked."""

    hold_id: HoldId
    number: Annotated[int, Field(ge=0, description="The offer's place in its hold, from 0.")]


class OfferLimits(WireModel):
    """The promise of an accepted offer: a booking keeps it, or nothing is booked.

    `within_s` counts from the mission's start to the last delivery.
    """

    provider_id: ProviderId
    price: Annotated[Price, Field(description="The price that was promised.")]
    within_s: Annotated[
        float,
        Field(ge=0, description="Seconds from the start of the mission to the last delivery."),
    ]
    hold: Annotated[
        OfferHold | None,
        Field(description="What was held when the offer was accepted; null without a hold."),
    ] = None
    tariff: Annotated[
        Tariff,
        Field(
            description="The provider's tariff when the offer was made: the offer is booked by it, "
            "even if the tariff has changed since."
        ),
    ]
    late_share: Annotated[
        float | None,
        Field(
            ge=0,
            description="The lateness that nine of ten packages do not exceed, as a share of the "
            "planned time. The P90 of the offer and of its booking follow from it. Null if it was "
            "not known.",
        ),
    ] = None


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
    asked_at: Annotated[
        FleetMoment | None,
        Field(
            description="When the customer asked. Of one class, who asked first is planned first."
        ),
    ] = None
    ready_at: Annotated[
        FleetMoment | None,
        Field(
            description="The customer's own `earliest_pickup_at`; that of `request` may be later, "
            "to wait for others to share the trip."
        ),
    ] = None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The drones to compare."""
        return self.shortlist.candidates


class Booking(WireModel):
    """BOOKED with its missions, BUSY (ask again later), INFEASIBLE (never), CLOSED (tombstone).

    WITHDRAWN: the request has changed since this attempt, which is booked no more.

    A later attempt books the packages that the missions of BOOKED do not carry; with a price limit
    or an offer, all packages are booked or none.
    """

    outcome: Annotated[
        Literal["BOOKED", "BUSY", "INFEASIBLE", "CLOSED", "WITHDRAWN"],
        Field(
            description="BOOKED, BUSY (ask again later), INFEASIBLE (never), CLOSED or WITHDRAWN."
        ),
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


class WithdrawMissions(WireModel):
    """The body of POST /internal/deliveries/{delivery_id}/withdrawals: its request changes.

    All missions are given up, or none. Attempts up to this one are not booked any more.
    """

    attempt: Annotated[int, Field(ge=1, description="The number of the last booking, from 1.")]


class GivenProof(WireModel):
    """The body of POST /internal/deliveries/{delivery_id}/proofs: this package has its proof.

    A repeated call is answered the same. 409 NOT_AWAITED: no drone waits for it, or not any more.
    """

    package_id: Annotated[PackageId, Field(description="The package, by the customer's id.")]


class ProofAnswer(WireModel):
    """The drone is instructed to hand the package over; it waits for proofs until `until_at`."""

    until_at: FleetMoment


class CancelMissions(WireModel):
    """The body of POST /internal/deliveries/{delivery_id}/cancellations; no packages mean all.

    A repeated `cancellation_id` gets the same answer.
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
    """What a cancellation leads to, package by package; mission reports say when it has happened.

    `released` packages surely stay at the pickup: their missions end, or go on without them.
    `returning` packages are on board, or may be loaded until their drone answers. The report
    RELEASED follows for packages that stay; the others come back to the pickup, or strand where a
    drone can land.
    `too_late` packages are delivered, or their delivery has ended in another way.
    """

    released: Annotated[
        tuple[PackageId, ...], Field(description="Packages that surely stay at the pickup.")
    ] = ()
    returning: Annotated[
        tuple[PackageId, ...],
        Field(description="Packages that are on board and come back, or may still be loaded."),
    ] = ()
    too_late: Annotated[
        tuple[PackageId, ...], Field(description="Packages that can no longer be stopped.")
    ] = ()

"""Composition to gateway and registry: what happened to missions.

One request may hold several reports, because each request costs more than the reports in it.
"""

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import Mission, MissionState, PackageEta
from skyway.geo import Position
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import WireModel

#: Paths for one report and for several, at the gateway and at the registry.
MISSION_REPORTS: Final = "/internal/mission-reports"
MANY_MISSION_REPORTS: Final = "/internal/mission-reports/many"


#: Codes of REFUSED for a QUEUED mission: composition has given it up, its drone has not refused it.
CALENDAR_CODES: Final = ("CALENDAR_CHANGED", "DRONE_NOT_FREE", "CANCELLED", "CHANGED")


class FreeFrom(WireModel):
    """Where and when a drone can begin another mission, after the last hand-over of this one."""

    at: FleetMoment
    station_id: StationId
    soc: Soc


class MissionReport(WireModel):
    """Composition to gateway and registry: one thing that happened to a mission.

    `seq` counts per mission from 1 without gaps; the sender repeats until answered 2xx. Kinds:

    QUEUED      it waits for the missions before it in its drone's calendar
    PROMISED    its promise is firm: it has the arrival times of `mission`
    ACCEPTED    the drone will fly it
    REFUSED     it will not (code); the mission is over and everything is freed
    LOADING     the mission has begun: approach flight, or loading at the pickup
    LOADED      the packages are on board
    ACTIVITY    `activity`, `station_id` and `soc` changed
    PROOF_AWAITED  the drone waits for the proofs of `package_ids`, until `until_at`
    PIN_ENTERED a person has typed `pin` at the drone's box, for one of `package_ids`
    DELIVERED   `package_ids` were handed over
    REPLANNING  the plan does not hold any more (`code`), another is looked for
    REPLANNED   the drone has taken a new revision of the plan (`mission` holds it)
    RETIMED     a QUEUED mission has other arrival times, which differ little (`mission`)
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
            "QUEUED",
            "PROMISED",
            "ACCEPTED",
            "REFUSED",
            "LOADING",
            "LOADED",
            "ACTIVITY",
            "PROOF_AWAITED",
            "PIN_ENTERED",
            "DELIVERED",
            "REPLANNING",
            "REPLANNED",
            "RETIMED",
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
    free_from: Annotated[
        FreeFrom | None,
        Field(description="When and where its drone can begin another mission; null if unknown."),
    ] = None
    drone_before: Annotated[
        DroneId | None,
        Field(description="The drone that had the QUEUED mission until now; null if it stays."),
    ] = None
    until_at: Annotated[
        FleetMoment | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Until when the drone waits for the proofs.",
        ),
    ] = None
    pin: Annotated[
        str | None,
        Field(
            repr=False,
            exclude_if=lambda value: value is None,
            description="The digits that were typed at the drone's box.",
        ),
    ] = None
    code: Annotated[str | None, Field(description="Why, for programs.")] = None
    detail: Annotated[str | None, Field(description="Why, for people.")] = None
    #: Evidence and numbers: place and weights at a hand-over, flown seconds and joules at the end.
    data: dict[str, Any] = Field(
        default_factory=dict,
        description="Evidence: place and masses at a hand-over, seconds and joules at the end.",
    )


class TracedReport(WireModel):
    """A report, and the trace that it belongs to."""

    traceparent: Annotated[
        str | None, Field(description="The W3C trace context of the report.")
    ] = None
    report: Annotated[MissionReport, Field(description="The report.")]


class MissionReports(WireModel):
    """Reports of different missions; if one is refused, each must be sent again alone."""

    reports: Annotated[tuple[TracedReport, ...], Field(description="The reports, in order.")]

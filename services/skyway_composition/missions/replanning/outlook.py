"""What a dry run says about a mission: its next landing, and what becomes of each package."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.delivery.request import Package
from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel
from skyway.units import ms_to_moment
from skyway_composition.closures.closure import ForeseenPlan
from skyway_composition.missions.mission.custody_store import Held, has_never_left
from skyway_composition.missions.replanning.find_plan import Found, Grounded, NewPlan, NoPlan
from skyway_composition.missions.replanning.propose import Revision
from skyway_composition.missions.replanning.situation import PlanningSituation, Situation

#: What becomes of a package.
PackageFate = Literal["DELIVERED", "RETURNED", "NOT_PICKED_UP", "LEFT_BEHIND", "WAITS", "UNKNOWN"]

#: Meanings of the codes of plans that cannot be made now.
NOT_YET: Final[Mapping[str, str]] = {
    "FAILSAFE_ACTIVE": "a failsafe leads the drone elsewhere; a plan is made when it is over",
    "HELD": "a plan is made when the mission is resumed",
    "IN_DOUBT": "a plan is made when it is known what the drone does",
    "NOT_ANSWERED": "the drone has not answered its newest plan yet",
    "START_UNKNOWN": "the drone must report, or a loader must confirm, before a plan is made",
}


class PackageOutlook(JsonModel):
    """What becomes of a package that is not handed over yet."""

    package_id: Annotated[PackageId, Field(description="Id of the package.")]
    fate: Annotated[
        PackageFate,
        Field(
            description="DELIVERED or RETURNED by the new plan; NOT_PICKED_UP; LEFT_BEHIND where "
            "the drone stands or lands; WAITS for another command or for a ground stop to end; "
            "UNKNOWN until a plan is found."
        ),
    ]
    station_id: Annotated[
        StationId | None,
        Field(description="Station where that happens; null if it is not known."),
    ]
    eta_at: Annotated[
        datetime | None,
        Field(description="Arrival by the present plan, fleet time; null if it has none."),
    ]
    new_eta_at: Annotated[
        datetime | None,
        Field(description="Arrival by the new plan, fleet time; null if it is not delivered."),
    ]
    later_by_s: Annotated[
        float | None,
        Field(
            description="How much later it arrives, seconds, negative if it arrives earlier; null "
            "without both arrivals."
        ),
    ] = None
    returns_at: Annotated[
        datetime | None,
        Field(description="When it is back, fleet time; null if it is not RETURNED."),
    ] = None


class PlannedLanding(JsonModel):
    """Where and when a drone lands next."""

    station_id: Annotated[StationId, Field(description="Station where the drone lands next.")]
    at: Annotated[datetime, Field(description="When it lands there, fleet time.")]


class MissionOutlook(JsonModel):
    """What a mission would do after a change, planned as of its drone's last report."""

    plan: Annotated[
        ForeseenPlan,
        Field(
            description="NEW_PLAN was found; NO_PLAN exists; NO_PLAN_YET can be made now; "
            "NOT_NEEDED; or TIME_UP before a plan was found."
        ),
    ]
    code: Annotated[
        str | None, Field(description="Why there is no plan, as a code; null if there is one.")
    ]
    detail: Annotated[str | None, Field(description="The same as a sentence.")]
    ends_mission: Annotated[bool, Field(description="Whether the mission ends by the change.")]
    next_landing: Annotated[
        PlannedLanding | None,
        Field(description="Next landing of the drone; null if it stays where it stands."),
    ]
    packages: Annotated[
        tuple[PackageOutlook, ...],
        Field(description="Each package that is not handed over yet."),
    ]
    reported_at: Annotated[
        datetime | None,
        Field(description="The drone's last report, fleet time, from which this was planned."),
    ]


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """A mission before a change that was rehearsed, and after it.

    `after` is None when the change ends the mission; `is_called_off` when the mission ends once its
    drone has agreed. `held` says who holds its packages after the change.
    """

    before: Situation
    after: PlanningSituation | None
    held: Mapping[PackageId, Held]
    is_called_off: bool


def packages_of(
    rehearsed: Rehearsed,
    found: Found | None,
    *,
    revision: Revision | None,
    landing: PlannedLanding | None,
) -> Iterator[PackageOutlook]:
    """What becomes of each package; `revision` is the new plan of what was `found`."""
    before = rehearsed.before
    etas = {each.package_id: each.eta_at for each in before.record.mission.packages}
    new_etas = _new_etas(revision)
    for package in before.record.request.packages:
        package_id = package.package_id
        is_open = package_id in before.carried or has_never_left(before.held.get(package_id))
        if not is_open:
            continue
        fate, station_id = _fate(rehearsed, package, found, revision=revision, landing=landing)
        eta_at, arrives_at = etas.get(package_id), new_etas.get(package_id)
        new_eta_at = arrives_at if fate == "DELIVERED" else None
        yield PackageOutlook(
            package_id=package_id,
            fate=fate,
            station_id=station_id,
            eta_at=eta_at,
            new_eta_at=new_eta_at,
            later_by_s=_seconds_between(eta_at, new_eta_at),
            returns_at=arrives_at if fate == "RETURNED" else None,
        )


def _seconds_between(earlier: datetime | None, later: datetime | None) -> float | None:
    return None if earlier is None or later is None else (later - earlier).total_seconds()


def _fate(
    rehearsed: Rehearsed,
    package: Package,
    found: Found | None,
    *,
    revision: Revision | None,
    landing: PlannedLanding | None,
) -> tuple[PackageFate, StationId | None]:
    """What becomes of a package, and at which station."""
    record, after = rehearsed.before.record, rehearsed.after
    pickup = record.request.pickup.station_id
    is_carried = package.package_id in rehearsed.before.carried
    remains = after is not None and package in after.record.packages(
        frozenset([package.package_id])
    )
    if not is_carried and (not remains or rehearsed.is_called_off or isinstance(found, NoPlan)):
        return "NOT_PICKED_UP", pickup
    if after is None or not remains or isinstance(found, NoPlan):
        return "LEFT_BEHIND", _place_of(rehearsed, package.package_id)
    if isinstance(found, NewPlan) and revision is not None:
        return _planned_fate(package, found, revision, pickup=pickup)
    if after.record.mission.is_held or isinstance(found, Grounded):
        lands_at = None if landing is None else landing.station_id
        stands_at = lands_at or _place_of(rehearsed, package.package_id)
        return "WAITS", stands_at if is_carried else pickup
    return "UNKNOWN", None


def _planned_fate(
    package: Package, found: NewPlan, revision: Revision, *, pickup: StationId
) -> tuple[PackageFate, StationId | None]:
    is_carried = package.package_id in found.anchor.carried
    end = _end_of(revision.steps, found)
    if found.remainder.given_up is not None and is_carried:
        return "LEFT_BEHIND", end
    if found.case.trouble.land_at is not None:
        return "WAITS", end if is_carried else pickup
    aims = {each.package_id: each for each in revision.aims}
    aim = aims.get(package.package_id)
    station_id = package.destination.station_id if aim is None else aim.station_id
    return "RETURNED" if aim is not None and aim.kind == "RETURN" else "DELIVERED", station_id


def _end_of(steps: Sequence[FlightStep], found: NewPlan) -> StationId:
    """Where a plan ends."""
    if not steps:
        return found.anchor.station_id
    last = steps[-1]
    return last.to_id if isinstance(last, FlyStep) else last.station_id


def _place_of(rehearsed: Rehearsed, package_id: PackageId) -> StationId | None:
    """Where a package on board is now, or is left; None while its drone is in the air."""
    held = rehearsed.held.get(package_id)
    if held is not None and held.custodian.kind == "STATION":
        return StationId(held.custodian.custodian_id)
    state = rehearsed.before.link.state
    return None if state is None else state.station_id


def _new_etas(revision: Revision | None) -> dict[PackageId, datetime]:
    packages = () if revision is None else revision.mission.packages
    return {each.package_id: each.eta_at for each in packages}


def landing_of(found: NewPlan, revision: Revision, *, is_flying: bool) -> PlannedLanding | None:
    """Where the drone lands next by a new plan; None if it flies no more."""
    anchor = found.anchor
    goes_on = bool(revision.steps) and isinstance(revision.steps[0], FlyStep)
    if is_flying and not goes_on:
        return PlannedLanding(station_id=anchor.station_id, at=ms_to_moment(anchor.at_ms))
    flights = (each for each in revision.steps if isinstance(each, FlyStep) and each.lands)
    first = next(flights, None)
    if first is None:
        return None
    return PlannedLanding(station_id=first.to_id, at=first.planned_end_at)

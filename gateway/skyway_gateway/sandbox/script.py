"""What the drone of a test delivery reports, from the booking to the end of its mission.

The moments of the reports are those of the plan. They are played within seconds, so the last ones
usually lie ahead of fleet time.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final, Literal

from skyway.contracts.mission import Cancellation, Mission, MissionState, PackageEta
from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.plan import Deliver, PickUp
from skyway.ids import PackageId, StationId
from skyway_gateway.sandbox.network import HUB, STATIONS
from skyway_gateway.sandbox.outcomes import OutcomeName

#: How late the packages of a late delivery are, fleet time.
LATE_BY: Final = timedelta(hours=1)

#: What a mission comes to: the outcome of its delivery, or the customer changes the request.
Ending = OutcomeName | Literal["changed"]

#: What somebody types at the drone who does not know the PIN.
_WRONG_PIN: Final = "00000000"
#: After so many wrong PINs only the customer can give the proof.
_WRONG_PINS: Final = 5

_ABSENT: Final = ("RECIPIENT_ABSENT", "nobody was at the destination")
#: How a mission ends that never leaves the pickup: kind, state, code and detail of its last report.
_EARLY_ENDS: Final[dict[Ending, tuple[str, MissionState, str, str]]] = {
    "refused": ("REFUSED", "REFUSED", "LOW_CHARGE", "the battery is not charged enough"),
    "withdrawn": ("REFUSED", "REFUSED", "DRONE_NOT_FREE", "the provider has withdrawn its drones"),
    "changed": ("REFUSED", "REFUSED", "CHANGED", "the customer has changed the request"),
    "weather": ("ENDED", "CANCELLED", "WEATHER_AHEAD", "the wind is too strong for the drone"),
}

#: Members of a report, each of its own type.
_Members = dict[str, Any]


@dataclass(frozen=True, slots=True)
class AwaitedProofs:
    """The packages that are handed over only with a proof, and until when the drone waits."""

    package_ids: Collection[PackageId]
    until_at: datetime


def script_of(
    mission: Mission, outcome: Ending, *, awaited: AwaitedProofs | None = None
) -> tuple[MissionReport, ...]:
    """The reports of a mission in their order, if nobody gives a proof."""
    members = tuple(_members(mission, outcome, awaited))
    return tuple(_report(mission, number, each) for number, each in enumerate(members, start=1))


def _report(mission: Mission, seq: int, members: _Members) -> MissionReport:
    return MissionReport.model_validate(
        {
            "report_id": f"rpt_{mission.mission_id}_{seq}",
            "delivery_id": mission.delivery_id,
            "attempt": mission.attempt,
            "trip": mission.trip,
            "mission_id": mission.mission_id,
            "provider_id": mission.provider_id,
            "drone_id": mission.drone_id,
            "seq": seq,
            "mission_state": "ACTIVE",
            **members,
        }
    )


def _members(
    mission: Mission, outcome: Ending, awaited: AwaitedProofs | None
) -> Iterator[_Members]:
    is_first = mission.attempt == 1
    early = _EARLY_ENDS.get(outcome) if is_first or outcome in ("weather", "changed") else None
    if early is None or early[0] == "ENDED":
        yield {"kind": "ACCEPTED", "at": mission.start_at, "mission_state": "ACCEPTED"}
    if early is not None:
        kind, state, code, detail = early
        yield {"kind": kind, "at": mission.start_at, "mission_state": state} | _why(code, detail)
        return
    pickup = next(each for each in mission.plan.steps if isinstance(each, PickUp))
    loaded_at = _moment(mission, pickup.end_s)
    here = {"station_id": mission.pickup_station_id}
    yield {"kind": "LOADING", "at": mission.start_at, **here}
    yield {"kind": "LOADED", "at": loaded_at, "package_ids": pickup.package_ids, **here}
    yield {"kind": "ACTIVITY", "at": loaded_at, "activity": "FLYING", **here}
    yield from _hand_overs(mission, outcome, loaded_at, awaited)


def _hand_overs(
    mission: Mission, outcome: Ending, loaded_at: datetime, awaited: AwaitedProofs | None
) -> Iterator[_Members]:
    package_ids = tuple(each.package_id for each in mission.packages)
    if outcome == "stranded":
        detail = "the drone had to land on the way"
        ended = {"kind": "ENDED", "at": loaded_at, "mission_state": "ABORTED"}
        left = {"station_id": HUB.station_id, "stranded_package_ids": package_ids}
        yield ended | left | _why("FORCED_LANDING", detail)
        return
    late_by = LATE_BY if outcome == "late" else timedelta(0)
    if outcome == "late":
        etas = [
            PackageEta(package_id=each.package_id, eta_at=each.eta_at + late_by)
            for each in mission.packages
        ]
        yield {"kind": "ACTIVITY", "at": loaded_at, "activity": "WAITING", "etas": etas}
    last_at = _moment(mission, mission.plan.delivery_time_s or 0.0) + late_by
    is_locked = outcome == "wrong_pin"
    if outcome == "undeliverable":
        yield from _returning(mission, package_ids, last_at, _ABSENT)
    else:
        for step in mission.plan.steps:
            if isinstance(step, Deliver):
                at = _moment(mission, step.end_s) + late_by
                yield from _hand_over(mission, step, at, awaited, has_wrong_pins=is_locked)
    yield _completed(last_at)


def _hand_over(
    mission: Mission,
    step: Deliver,
    at: datetime,
    awaited: AwaitedProofs | None,
    *,
    has_wrong_pins: bool,
) -> Iterator[_Members]:
    """What needs no proof is delivered; for the rest the drone waits, and brings it back."""
    proven = () if awaited is None else awaited.package_ids
    free = tuple(each for each in step.package_ids if each not in proven)
    if free:
        yield _delivered(step.station_id, free, at)
    waiting = tuple(each for each in step.package_ids if each in proven)
    if awaited is None or not waiting:
        return
    named = {"at": at, "station_id": step.station_id, "package_ids": waiting}
    yield {"kind": "PROOF_AWAITED", "until_at": awaited.until_at} | named
    if has_wrong_pins:
        yield from [{"kind": "PIN_ENTERED", "pin": _WRONG_PIN} | named] * _WRONG_PINS
    yield from _returning(mission, waiting, at, _ABSENT)


def _delivered(station_id: StationId, package_ids: Collection[PackageId], at: datetime) -> _Members:
    return {
        "kind": "DELIVERED",
        "at": at,
        "station_id": station_id,
        "package_ids": tuple(package_ids),
        "data": {"place": {"position": list(STATIONS[station_id].position)}},
    }


def _returning(
    mission: Mission,
    package_ids: Collection[PackageId],
    at: datetime,
    why: tuple[str, str],
) -> Iterator[_Members]:
    named = {"at": at, "package_ids": tuple(package_ids)} | _why(*why)
    yield {"kind": "RETURNING"} | named
    yield {"kind": "RETURNED", "station_id": mission.pickup_station_id} | named


def _completed(at: datetime) -> _Members:
    return {"kind": "ENDED", "at": at, "mission_state": "COMPLETED"}


def _why(code: str, detail: str) -> _Members:
    return {"code": code, "detail": detail}


def _moment(mission: Mission, after_s: float) -> datetime:
    return mission.start_at + timedelta(seconds=after_s)


def cancelled(
    mission: Mission,
    reports: Sequence[MissionReport],
    played: int,
    *,
    package_ids: Collection[PackageId],
    reason: str,
) -> tuple[tuple[MissionReport, ...], Cancellation]:
    """The reports without these packages from now on, and what becomes of the packages.

    `played` reports have happened. A repeated cancellation changes nothing.
    """
    past, future = reports[:played], reports[played:]
    own = [each.package_id for each in mission.packages if each.package_id in package_ids]
    loaded = _named(past, "LOADED")
    on_board = [each for each in own if each in loaded]
    over = _named(past, "DELIVERED", "RETURNED") if future else loaded
    open_ids = [each for each in on_board if each not in over]
    turned = [each for each in open_ids if each not in _named(past, "RETURNING")]
    released = [each for each in own if each not in loaded]
    rest = [*_without(future, {*turned, *released})]
    if turned:
        last_at = max(future[-1].at, past[-1].at)
        rest[-1:-1] = _returning(mission, turned, last_at, ("CANCELLED", reason))
    elif future and not loaded and len(released) == len(mission.packages):
        ended = {"kind": "ENDED", "at": mission.start_at, "mission_state": "CANCELLED"}
        rest = [ended | _why("CANCELLED", reason)]
    new = (_report(mission, played + number, each) for number, each in enumerate(rest, start=1))
    done = Cancellation(
        released=tuple(released),
        returning=tuple(open_ids),
        too_late=tuple(each for each in on_board if each in over),
    )
    return (*past, *new), done


def proven(
    mission: Mission, reports: Sequence[MissionReport], played: int, package_id: PackageId
) -> tuple[MissionReport, ...]:
    """The reports from now on if the drone that waits hands this package over.

    `played` reports have happened. A repeated proof changes nothing.
    """
    past, future = reports[:played], reports[played:]
    waits = [
        each for each in past if each.kind == "PROOF_AWAITED" and package_id in each.package_ids
    ]
    if not waits or package_id not in _named(future, "RETURNED"):
        return tuple(reports)
    station_id = waits[-1].station_id or mission.pickup_station_id
    done = _delivered(station_id, [package_id], waits[-1].at)
    rest = [done, *_without(future, {package_id})]
    new = (_report(mission, played + number, each) for number, each in enumerate(rest, start=1))
    return (*past, *new)


def _named(reports: Sequence[MissionReport], *kinds: str) -> set[PackageId]:
    return {each for one in reports if one.kind in kinds for each in one.package_ids}


def _without(reports: Sequence[MissionReport], gone: Collection[PackageId]) -> Iterator[_Members]:
    """The members of the reports; those that are only about these packages are left out."""
    for report in reports:
        kept = tuple(each for each in report.package_ids if each not in gone)
        if kept or not report.package_ids:
            own = report.model_dump(exclude={"seq", "report_id"})
            yield own | {"package_ids": kept}

"""Where the drones of a test delivery are, as far as their reports have been played."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Literal

from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.delivery.plan import Fly, Step
from skyway_gateway.sandbox.network import STATIONS
from skyway_gateway.sandbox.store import SandboxMission


def track_of(missions: Sequence[SandboxMission]) -> Track:
    """The steps of all missions and the last positions of their drones."""
    return Track(
        missions=tuple(_tracked(each) for each in missions if each.reports[-1].kind != "REFUSED"),
        station_names={name: each.name or "" for name, each in STATIONS.items()},
    )


def _tracked(flown: SandboxMission) -> TrackedMission:
    mission, now = flown.mission, flown.mission.start_at
    if flown.played:
        now = flown.reports[flown.played - 1].at
    here = mission.pickup_station_id
    steps = list[TrackedStep]()
    for step in mission.plan.steps:
        start_at, end_at = (
            mission.start_at + timedelta(seconds=each) for each in (step.start_s, step.end_s)
        )
        there = step.to_id if isinstance(step, Fly) else step.station_id
        steps.append(
            TrackedStep(
                kind=step.kind,
                status=_status(start_at, end_at, now, is_over=flown.is_over),
                from_position=STATIONS[here].position,
                to_position=STATIONS[there].position,
                station_id=there,
                start_at=start_at,
                end_at=end_at,
                package_ids=_package_ids(step),
            )
        )
        here = there
    ended = [each for each in steps if each.status == "ENDED"]
    position = ended[-1].to_position if ended else steps[0].from_position
    return TrackedMission(
        mission_id=mission.mission_id,
        provider_id=mission.provider_id,
        drone_id=mission.drone_id,
        steps=tuple(steps),
        position=position,
        position_at=now,
        soc=None,
    )


def _status(
    start_at: datetime, end_at: datetime, now: datetime, *, is_over: bool
) -> Literal["ENDED", "UNDER_WAY", "PLANNED", "FAILED"]:
    if end_at <= now:
        return "ENDED"
    if is_over:
        return "FAILED"
    return "UNDER_WAY" if start_at < now else "PLANNED"


def _package_ids(step: Step) -> tuple[str, ...]:
    return getattr(step, "package_ids", ())

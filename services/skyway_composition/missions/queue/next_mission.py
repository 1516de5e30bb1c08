"""Decides what to do about a drone's next QUEUED mission: a pure decision."""

from dataclasses import dataclass

from skyway.scheduling.stays import Slot, first_slot, stay_to_begin_at
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.standby import WORTH_MS


@dataclass(frozen=True, slots=True)
class Leave:
    """Do nothing now: the mission fits, or what it depends on is not known yet."""


@dataclass(frozen=True, slots=True)
class Shorten:
    """End the standby of the mission before at `until_ms`, so that the next one can begin."""

    until_ms: int


@dataclass(frozen=True, slots=True)
class Send:
    """The drone stands where the mission begins: send it."""


@dataclass(frozen=True, slots=True)
class PlanAgain:
    """The mission no longer fits: plan the drone's QUEUED missions again from this slot on."""

    slot: Slot


@dataclass(frozen=True, slots=True)
class GiveUp:
    """The drone cannot begin the mission, so another drone must be found."""

    detail: str


Decision = Leave | Shorten | Send | PlanAgain | GiveUp


@dataclass(frozen=True, slots=True)
class Times:
    """The present moment and spans of fleet time, in milliseconds.

    `reach_ms`: until an instruction reaches the drone. `plan_ms`: the same, with the time to plan
    first. `hand_over_ms`: between two missions. `send_ahead_ms`: how long before its start an idle
    drone gets a mission; `send_waiting_ms`: the same, if the mission waits for deliveries that
    share its trip. `longest_wait_ms`: how long after its planned start a mission waits for
    its drone.
    """

    now_ms: int
    reach_ms: int
    plan_ms: int
    hand_over_ms: int
    send_ahead_ms: int
    send_waiting_ms: int
    longest_wait_ms: int

    def is_soon(self, following: MissionRecord) -> bool:
        """Whether a mission begins so soon that an idle drone gets it now."""
        waits = following.request.qos.pooling_wait_s > 0
        ahead_ms = self.send_waiting_ms if waits else self.send_ahead_ms
        return following.start.at_ms <= self.now_ms + ahead_ms

    def is_overdue(self, following: MissionRecord) -> bool:
        """Whether a mission has waited too long for its drone."""
        return self.now_ms > following.start.at_ms + self.longest_wait_ms


def decide(
    following: MissionRecord,
    *,
    before: MissionRecord | None,
    link: DroneLink | None,
    is_planned_in_this_world: bool,
    times: Times,
) -> Decision:
    """What to do about the drone's next mission; `before` is its live mission, if it has one."""
    if before is not None:
        found = _after(following, before, is_in_this_world=is_planned_in_this_world, times=times)
    else:
        found = _when_free(following, link, is_in_this_world=is_planned_in_this_world, times=times)
    if isinstance(found, Leave) and times.is_overdue(following):
        return GiveUp("the drone is not free for its next mission")
    return found


def _after(
    following: MissionRecord, before: MissionRecord, *, is_in_this_world: bool, times: Times
) -> Decision:
    stays = before.stays
    if before.mission.state == "BOOKED" or before.proposal is not None or not stays:
        return Leave()
    reached_ms = times.now_ms + times.reach_ms
    start = following.start
    planned = Slot(start.station_id, start.at_ms - times.hand_over_ms, start.soc)
    stay = stay_to_begin_at(stays, planned, not_left_before_ms=reached_ms)
    if stay is None or not is_in_this_world:
        slot = first_slot(stays, not_before_ms=reached_ms)
        if slot is None:
            return Leave()
        return PlanAgain(Slot(slot.station_id, slot.at_ms + times.hand_over_ms, slot.soc))
    if stay.until_ms is None:
        return Leave()
    until_ms = max(stay.from_ms, min(stay.until_ms, planned.at_ms))
    return Shorten(until_ms)


def _when_free(
    following: MissionRecord, link: DroneLink | None, *, is_in_this_world: bool, times: Times
) -> Decision:
    state = None if link is None else link.state
    if link is None or state is None or link.has_unread_events:
        return Leave()
    if state.activity == "DOWN":
        return GiveUp("its drone has landed away from every station")
    if link.is_occupied or state.station_id is None:
        return Leave()
    here = Slot(state.station_id, times.now_ms + times.plan_ms, state.soc)
    start = following.start
    is_in_time = times.now_ms + times.reach_ms <= start.at_ms
    can_be_sooner = max(here.at_ms, following.earliest_ms) + WORTH_MS < start.at_ms
    if not is_in_this_world or not is_in_time or can_be_sooner or not here.allows(start):
        return PlanAgain(here)
    return Send() if times.is_soon(following) else Leave()

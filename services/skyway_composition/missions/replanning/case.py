"""One mission to plan for: what is known of it, why it needs another plan, and in which world."""

from dataclasses import dataclass, replace

from skyway.ids import StationId
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.outlook.situation import Situation
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.closed_ahead import ClosedAhead
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class Case:
    """All that a new plan is made from; whoever keeps one looks again whether it still is so.

    `sent_revisions` counts what was ever sent, taken or not: a number is used once.
    """

    situation: Situation
    trouble: Trouble
    world: World
    closed: ClosedAhead
    sent_revisions: int

    @property
    def record(self) -> MissionRecord:
        """The mission as it was looked at."""
        return self.situation.record

    @property
    def waits_for_operator(self) -> bool:
        """Whether the drone is held, and nobody has said where."""
        return self.record.mission.is_held and self.trouble.land_at is None

    def landing_at(self, station_id: StationId) -> "Case":
        """The same of a drone that is to land there, and wait."""
        trouble = self.trouble.model_copy(update={"land_at": station_id})
        return replace(self, trouble=trouble)

    def ground_stop(self, anchor: Anchor) -> str | None:
        """Why the drone may not take off at the anchor; None when it may, or flies on there."""
        if anchor.is_in_the_air:
            return None
        standing = self.record.candidate.model_copy(update={"station_id": anchor.station_id})
        return self.world.conditions.ground_stop(standing, at_ms=anchor.at_ms)

    def is_unchanged(self, work: MissionUnitOfWork, record: MissionRecord) -> bool:
        """Whether the mission still waits, for the same reason, and its drone is where it was."""
        known, was = self.record, self.situation.link.state
        state = work.links[record.drone_id].state
        progress = None if state is None else (state.step_id, state.released_through)
        known_progress = None if was is None else (was.step_id, was.released_through)
        return progress == known_progress and _inputs(record) == _inputs(known)


def trouble_of(record: MissionRecord) -> Trouble | None:
    """Why a mission needs another plan; that its drone is stuck comes first."""
    if record.stuck is None:
        return record.trouble
    land_at = None if record.trouble is None else record.trouble.land_at
    return Trouble(code=record.stuck.code, detail=record.stuck.detail, land_at=land_at)


def may_be_planned(situation: Situation, trouble: Trouble) -> bool:
    """Whether a plan can be made now.

    Not for a drone that has not answered yet, or is led elsewhere by a failsafe: it would refuse
    new steps until that is over, unless they override it. One that is held flies on to its next
    landing, which may be closed, and begins nothing there.
    """
    record = situation.record
    if record.mission.state == "BOOKED" or record.proposal is not None:
        return False
    if situation.steering_failsafe is not None and not trouble.overrides_failsafe:
        return False
    if not record.mission.is_held or trouble.land_at is not None:
        return True
    state = situation.link.state
    return state is not None and (state.mission_id, state.activity) == (
        record.mission_id,
        "FLYING",
    )


def _inputs(record: MissionRecord) -> tuple[object, ...]:
    return (
        record.mission_id,
        record.mission.revision,
        # New steps would end a hold that was ordered while they were planned.
        record.mission.is_held,
        record.stuck,
        record.trouble,
        record.proposal,
        record.request,
        record.aims,
    )

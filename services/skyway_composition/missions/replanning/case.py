"""One mission to plan for: its situation, why it needs another plan, and in which world."""

from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.instruction import RefusalCode
from skyway.ids import ClosureId, StationId
from skyway.runtime.clock import FleetClock
from skyway.units import moment_to_ms
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.closures.closure import Closure
from skyway_composition.margins import REACHES_SURELY
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.replanning.remainder.anchor import (
    Anchor,
    anchor_of_stuck,
    find_anchor,
)
from skyway_composition.missions.replanning.situation import Situation
from skyway_composition.planning.problem_for import with_margin
from skyway_composition.planning.world import ClosedAhead, World

#: If a drone had too little energy for its plan, the next plan has so much more margin.
_MORE_AFTER_REFUSAL: Final = 0.05


@dataclass(frozen=True, slots=True)
class Case:
    """All that a new plan is made from; it is checked again before the plan is sent.

    `sent_revisions` is the number of the newest revision ever sent, accepted or not; a number is
    used once. `felt_margin` is the energy margin that the plan needs in the wind that the drone
    feels.
    """

    situation: Situation
    trouble: Trouble
    world: World
    closed: ClosedAhead
    sent_revisions: int
    felt_margin: float = 0.0

    @property
    def energy_margin(self) -> float:
        """The share of energy that the plan adds to what the drone's planned model says."""
        return max(self.situation.energy_margin(self.world), self.felt_margin)

    @property
    def margin_after_refusal(self) -> float:
        """The margin of the next plan if the drone had too little energy for the last one, else 0.

        The drone may use more than it has reported. So each time a little is added.
        """
        stuck = self.record.stuck
        if stuck is None or stuck.code != RefusalCode.INSUFFICIENT_ENERGY:
            return 0.0
        return round(self.record.mission.margins.energy_margin + _MORE_AFTER_REFUSAL, 2)

    @property
    def record(self) -> MissionRecord:
        """The mission as it was read."""
        return self.situation.record

    @property
    def waits_for_operator(self) -> bool:
        """Whether the drone is held without a station to which it is diverted."""
        return self.record.mission.is_held and self.trouble.land_at is None

    def landing_at(self, station_id: StationId) -> "Case":
        """The same case with the drone diverted to this station, to wait there."""
        trouble = self.trouble.model_copy(update={"land_at": station_id})
        return replace(self, trouble=trouble)

    def anchor(
        self, *, closed: ClosedAhead, clock: FleetClock, before_step: int | None = None
    ) -> Anchor | None:
        """The place and moment from which the plan can be changed; see `find_anchor`."""
        earliest_ms = 1 + moment_to_ms(clock.now() + REACHES_SURELY.span(clock))
        stuck = self.record.stuck
        if stuck is not None:
            anchor = anchor_of_stuck(self.situation, stuck, earliest_ms=earliest_ms)
            return anchor if before_step is None else None
        return find_anchor(
            self.situation,
            self.trouble,
            model=with_margin(self.situation.model, self.energy_margin),
            closed=closed,
            now_ms=moment_to_ms(clock.now()),
            earliest_ms=earliest_ms,
            before_step=before_step,
        )

    def ground_stop(self, anchor: Anchor) -> str | None:
        """Why the drone may not take off at the anchor; None when it may, or flies over it."""
        if anchor.is_in_the_air:
            return None
        standing = self.record.candidate.model_copy(update={"station_id": anchor.station_id})
        return self.world.conditions.ground_stop(standing, at_ms=anchor.at_ms)

    @property
    def seen(self) -> Snapshot:
        """What the plan depends on: also the step at which the drone was."""
        link = self.situation.link
        return Snapshot(
            self.world.present,
            {link.drone_id: link.calendar_version},
            {link.drone_id: link.at_step},
        )


def trouble_of(record: MissionRecord) -> Trouble | None:
    """Why a mission needs another plan; a stuck drone comes before any other trouble."""
    if record.stuck is None:
        return record.trouble
    land_at = None if record.trouble is None else record.trouble.land_at
    return Trouble(code=record.stuck.code, detail=record.stuck.detail, land_at=land_at)


def may_be_planned(situation: Situation, trouble: Trouble) -> bool:
    """Whether a plan can be made now; see `planning_obstacle`."""
    return planning_obstacle(situation, trouble) is None


def planning_obstacle(situation: Situation, trouble: Trouble) -> str | None:
    """The code of why no plan can be made now; None when one can be made.

    A drone that has not answered yet gets no new plan. A mission in doubt gets none either. A drone
    that is led elsewhere by a failsafe would refuse new steps, unless they override the failsafe. A
    held drone gets a plan only if it is diverted, or in flight: its next landing may be closed.
    """
    record = situation.record
    mission, state = record.mission, situation.link.state
    is_flying = state is not None and (state.mission_id, state.activity) == (
        record.mission_id,
        "FLYING",
    )
    if mission.doubt is not None:
        return "IN_DOUBT"
    if mission.state == "BOOKED" or record.proposal is not None:
        return "NOT_ANSWERED"
    if situation.steering_failsafe is not None and not trouble.overrides_failsafe:
        return "FAILSAFE_ACTIVE"
    return "HELD" if mission.is_held and trouble.land_at is None and not is_flying else None


def outage_of(record: MissionRecord, *, now_ms: int) -> Closure | None:
    """The outage, not made yet, of the pad that this mission's drone found occupied."""
    occupied = None if record.stuck is None else record.stuck.occupied
    if occupied is None or occupied.until_ms <= now_ms:
        return None
    return Closure(
        closure_id=ClosureId(""),
        kind="PAD",
        network_id=record.network_id,
        station_id=occupied.station_id,
        pad=occupied.pad,
        reason=f"drone {record.drone_id} found it occupied",
        from_ms=now_ms,
        until_ms=occupied.until_ms,
        made_ms=now_ms,
    )

"""Where a drone is in its mission: by its newest state, or by an event that is newer."""

from dataclasses import dataclass

from skyway.contracts.drone_report import DroneEvent, DroneState
from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.geo import Position
from skyway.ids import StationId
from skyway.units import moment_to_ms
from skyway_composition.missions.outlook.situation import Situation


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """What a drone was doing at `at_ms`.

    `next_step` is under way, or the next to begin; those up to `released_through` cannot be
    replaced but by a DIVERT. `free_ms` is when the step before it had ended.
    """

    at_ms: int
    soc: float
    position: Position | None
    station_id: StationId | None
    next_step: int
    released_through: int
    free_ms: int

    @property
    def is_under_way(self) -> bool:
        """Whether the next step has begun."""
        return self.next_step <= self.released_through

    def is_doing(self, step: FlightStep) -> bool:
        """Whether this step has begun and not ended."""
        return self.is_under_way and step.step_id == self.next_step


def whereabouts(situation: Situation) -> Whereabouts | None:
    """Where the drone is; None when it has not said anything of this mission yet."""
    state, last = situation.link.state, _last_event(situation)
    if state is not None and state.mission_id == situation.record.mission_id:
        next_step = state.step_id if state.step_id is not None else situation.last_step + 1
        if next_step >= situation.next_step:
            return _by_state(state, next_step, last)
    if last is not None:
        return _by_event(situation, last)
    if situation.record.mission.state == "BOOKED":
        return None
    return _waiting_to_begin(situation)


def _last_event(situation: Situation) -> DroneEvent | None:
    events = [each.event for each in situation.steps if each.event is not None]
    return events[-1] if events else None


def _by_state(state: DroneState, next_step: int, last: DroneEvent | None) -> Whereabouts:
    at_ms = moment_to_ms(state.at)
    return Whereabouts(
        at_ms=at_ms,
        soc=state.soc,
        position=state.position,
        station_id=state.station_id,
        next_step=next_step,
        released_through=state.released_through or 0,
        free_ms=at_ms if last is None else moment_to_ms(last.ended_at),
    )


def _by_event(situation: Situation, event: DroneEvent) -> Whereabouts:
    """After a flight that did not land the next one is under way, and all up to the landing."""
    ended = next(each.step for each in situation.steps if each.event is event)
    is_airborne = isinstance(ended, FlyStep) and not ended.lands
    released = _landing(situation.planned) if is_airborne else situation.next_step - 1
    at_ms = moment_to_ms(event.ended_at)
    return Whereabouts(
        at_ms=at_ms,
        soc=event.soc,
        position=event.position,
        station_id=None if is_airborne else event.station_id,
        next_step=situation.next_step,
        released_through=released,
        free_ms=at_ms,
    )


def _waiting_to_begin(situation: Situation) -> Whereabouts:
    candidate, state = situation.record.candidate, situation.link.state
    start_ms = moment_to_ms(situation.record.mission.start_at)
    return Whereabouts(
        at_ms=start_ms if state is None else moment_to_ms(state.at),
        soc=candidate.soc if state is None else state.soc,
        position=None,
        station_id=candidate.station_id,
        next_step=situation.next_step,
        released_through=situation.next_step - 1,
        free_ms=start_ms,
    )


def _landing(planned: tuple[FlightStep, ...]) -> int:
    return next(
        (each.step_id for each in planned if isinstance(each, FlyStep) and each.lands),
        planned[-1].step_id if planned else 0,
    )

"""A mission at one moment: its steps and packages, its drone's last report and failsafe."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import prod
from typing import Final, Self

from skyway.contracts.drone_report import (
    ActiveFailsafe,
    DroneEvent,
    DroneState,
    Failsafe,
    Fault,
    Wind,
)
from skyway.contracts.flight_step import FlightStep, FlyStep, PickUpStep
from skyway.drone.learned_values import model_as_learned
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, PackageId, StationId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.stays import Slot
from skyway.units import moment_to_ms
from skyway_composition.context import Context
from skyway_composition.links.instruction_store import last_revision
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.custody_store import Held, on_board
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.step_store import StepRecord
from skyway_composition.missions.mission.store import queued_of_drone
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.felt_wind import air_ahead, next_flights, planned_air
from skyway_composition.planning.problem_for import planned_more
from skyway_composition.planning.world import World

#: While one of these failsafes is active, a drone refuses new steps that do not override it.
_STEERING: Final = (Failsafe.DIVERT, Failsafe.LAND_NOW)


@dataclass(frozen=True, slots=True)
class Situation:
    """A mission as read in one transaction; `held` has the packages of this mission only."""

    record: MissionRecord
    link: DroneLink
    steps: tuple[StepRecord, ...]
    held: Mapping[PackageId, Held]

    @classmethod
    async def of(cls, work: MissionUnitOfWork, record: MissionRecord) -> Self:
        """The situation of a locked mission."""
        held = await work.custody.held_on(record)
        steps = await work.steps.of(record.mission_id)
        return cls(record, work.links[record.drone_id], tuple(steps), record.own(held))

    @property
    def planned(self) -> tuple[FlightStep, ...]:
        """The steps whose end was not reported yet, in order."""
        return tuple(each.step for each in self.steps if each.status == "PLANNED")

    @property
    def next_step(self) -> int:
        """The first step whose end was not reported; one after the last step if all have ended."""
        planned = self.planned
        return planned[0].step_id if planned else self.last_step + 1

    @property
    def last_step(self) -> int:
        """The number of the last step."""
        return self.steps[-1].step.step_id if self.steps else 0

    @property
    def carried(self) -> frozenset[PackageId]:
        """The packages on board, by the events that were reported."""
        return on_board(self.held)

    @property
    def has_loaded(self) -> bool:
        """Whether the pickup has ended, so that nothing more is fetched there."""
        return any(
            isinstance(each.step, PickUpStep) and each.status == "ENDED" for each in self.steps
        )

    @property
    def steering_failsafe(self) -> ActiveFailsafe | None:
        """The failsafe that leads the drone elsewhere now; None while it follows its plan."""
        return steering_failsafe(self.record, self.link.state)

    @property
    def consumption_factor(self) -> float:
        """The drone's last reported energy use relative to its plan; 1 before a report."""
        return self._factor_beyond(planned_air)

    @property
    def felt_wind(self) -> Wind | None:
        """The wind that the drone has reported; None if it has reported none."""
        health = None if self.link.state is None else self.link.state.health
        return None if health is None else health.wind

    @property
    def lasting_factor(self) -> float:
        """`consumption_factor` without the effect of the wind that the drone feels."""
        in_calm_air = self._factor_in_calm_air
        return self.consumption_factor if in_calm_air is None else in_calm_air

    @property
    def model(self) -> DroneModel:
        """The drone's planned model; a lower charge rate that the drone reports counts immediately.

        Otherwise each session of the mission would be planned too short.
        """
        candidate, state = self.record.candidate, self.link.state
        health = None if state is None else state.health
        reported = None if health is None else health.charge_rate_factor
        return model_as_learned(candidate.model, candidate.learned.charging_at_most(reported))

    def energy_margin(self, world: World, *, at_ms: int) -> float:
        """The share of energy that plans from this moment add to what the planned model says.

        The wind that the weather of this world already has is not added again.
        """
        candidate = self.record.candidate
        margin = world.for_drone(candidate.learned).energy_margin(candidate.model)
        factor = self._factor_beyond(partial(_air_in, world, candidate.model, at_ms))
        # The next flights may have a tail wind, and the flights after them none.
        return max(margin, planned_more(max(factor, self._factor_in_calm_air or 0.0)))

    @property
    def needs_pad_closed(self) -> bool:
        """Whether the drone found its pad occupied, so that this pad must be closed."""
        stuck = self.record.stuck
        return stuck is not None and stuck.occupied is not None

    @property
    def masses_kg(self) -> dict[PackageId, float]:
        """The mass of each package of the mission."""
        return {each.package_id: each.mass_kg for each in self.record.request.packages}

    def _factor_beyond(self, air: Callable[[FlyStep], float]) -> float:
        """The drone's last reported energy use relative to its planned model in this `air`.

        `air` is by how much the weather multiplies the energy of a flight.
        """
        state = self.link.state
        # The report is about the flights that were ahead of the drone then.
        first = self.next_step if state is None or state.step_id is None else state.step_id
        ahead = [each.step for each in self.steps if each.step.step_id >= first]
        flights = next_flights(
            ahead,
            self.record.candidate.model,
            masses_kg=self.masses_kg,
            carried=self.carried,
            air=air,
        )
        return factor_beyond(self.record, state, in_air=air_ahead(flights))

    @property
    def _factor_in_calm_air(self) -> float | None:
        """The drone's energy use without wind, relative to its planned model; None if unknown."""
        health = None if self.link.state is None else self.link.state.health
        # A battery without any health says nothing about the use in calm air.
        if health is None or health.wind is None or not health.state_of_health:
            return None
        in_calm_air = (health.still_air_factor or 1.0) / health.state_of_health
        return self.record.candidate.learned.beyond(in_calm_air)


def _air_in(world: World, model: DroneModel, now_ms: int, flight: FlyStep) -> float:
    """By how much the weather of a world multiplies the energy of a planned flight.

    For a flight under way it is the weather of this moment: it may be newer than the flight.
    """
    at_ms = max(now_ms, moment_to_ms(flight.planned_start_at))
    known = world.conditions.weather
    if known is None or not known.counts_from(at_ms):
        return 1.0
    weather = known.of_model(model, world.use_deviation)
    return prod(weather.air_between(flight.from_id, flight.to_id, at_s=at_ms / 1000))


def factor_beyond(record: MissionRecord, state: DroneState | None, *, in_air: float) -> float:
    """The energy use in a drone's report relative to its plan; 1 before a report.

    The drone compares its use with its model in still air. Its plan already includes what was
    learned about the drone, and the weather, which multiplies the energy of its next flights by
    `in_air`.
    """
    if state is None or state.health is None:
        return 1.0
    return record.candidate.learned.beyond(state.health.consumption_factor) / in_air


def steering_failsafe(record: MissionRecord, state: DroneState | None) -> ActiveFailsafe | None:
    """The failsafe that leads a mission's drone elsewhere; None while it follows its plan.

    A drone refuses new steps meanwhile, unless they override the failsafe.
    """
    if record.stuck is not None or state is None or state.failsafe is None:
        return None
    is_of_this = state.mission_id == record.mission_id
    return state.failsafe if is_of_this and state.failsafe.failsafe in _STEERING else None


def waits_for_pad(record: MissionRecord, link: DroneLink) -> bool:
    """Whether a mission's drone waits beside an occupied pad.

    A state from before its last event does not count: the drone may have charged meanwhile.
    """
    state = link.state
    if state is None or state.mission_id != record.mission_id:
        return False
    if state.last_event_seq < link.last_event_seq:
        return False
    return state.activity == "RECHARGING" and Fault.PAD_OCCUPIED in state.faults


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """What a drone was doing at `at_ms`.

    `next_step` is under way, or is the next to begin. Only a DIVERT can replace steps up to
    `released_through`. `free_ms` is the end of the step before `next_step`.
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
    """Where the drone is; None before its first report about this mission."""
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
    """Where the drone is after its newest event.

    After a flight that does not land the next flight is under way, and all flights up to the
    landing are released.
    """
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


@dataclass(frozen=True, slots=True)
class NextMissions:
    """The QUEUED missions of a drone, and from where and when the first begins."""

    ids: tuple[MissionId, ...]
    start: Slot | None

    @classmethod
    async def read(cls, tx: Tx, drone_id: DroneId) -> Self:
        """The missions that wait behind the drone's live mission."""
        queued = await queued_of_drone(tx.connection, drone_id)
        return cls(tuple(each.mission_id for each in queued), queued[0].start if queued else None)


@dataclass(frozen=True, slots=True)
class PlanningSituation(Situation):
    """A situation with what another plan depends on besides.

    `sent_revisions` is the number of the newest revision ever sent, accepted or not; a number is
    used once. `queued` are the drone's next missions.
    """

    sent_revisions: int
    queued: NextMissions

    @classmethod
    async def of(cls, work: MissionUnitOfWork, record: MissionRecord) -> Self:
        """The situation of a locked mission, to plan for it."""
        seen = await Situation.of(work, record)
        sent = max(record.mission.revision, await last_revision(work.tx, record.mission_id))
        queued = await NextMissions.read(work.tx, record.drone_id)
        return cls(seen.record, seen.link, seen.steps, seen.held, sent, queued)


async def read_situation(context: Context, drone_id: DroneId) -> PlanningSituation | None:
    """The situation of a drone's mission; None when the drone has no live mission."""
    async with context.db.write() as tx:
        work = await MissionUnitOfWork.lock(context, tx, [drone_id])
        record = work.missions.get(drone_id)
        return None if record is None else await PlanningSituation.of(work, record)

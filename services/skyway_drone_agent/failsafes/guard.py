"""The guard: looks for faults, raises alarms and begins what the failsafes say.

The severe failsafes begin another flight, a landing on the spot, or a failed step. Each decision is
in the journal first, and the pilot does what the logbook says. So after a crash in the middle of an
escape the drone continues the escape and does nothing twice.
"""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Final, Never

from skyway.contracts.drone_report import Failsafe, Fault
from skyway.contracts.flight_step import FlyStep, RechargeStep
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.analysis.analysis import Assessment, Lookout
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.failsafes.failsafe import (
    Situation,
    failsafe_for,
    is_severer,
    not_ignored,
    severest,
    situation_of,
)
from skyway_drone_agent.failsafes.faults import (
    SOC_MARGIN,
    FaultMonitor,
    Signs,
    in_words,
    level_of,
    numbers_behind,
)
from skyway_drone_agent.journal.flight_recorder import FlightRecorder, NewsOrMoment
from skyway_drone_agent.journal.logbook import CurrentMission, Escape, run_under_way
from skyway_drone_agent.journal.mission_changes import Place, descent, flight_to
from skyway_drone_agent.journal.records import FailsafeBegun, FaultEnded, HealthLearned
from skyway_drone_agent.link.events import EventWriter
from skyway_drone_agent.link.link_monitor import CloudMonitor, Heartbeat, LinkMonitor, at_tick
from skyway_drone_agent.vehicle import StepRun, Vehicle

#: How long a drone stands beside its pad before it asks for another plan (fleet time).
PAD_WAIT: Final = timedelta(seconds=120)

#: Seconds between two looks in the air: of fleet time, or of wall time if that is longer.
_FLYING_EVERY_S, _EVERY_WALL_S = 1.0, 0.25

#: The same on the ground, while a step is under way or there is a fault.
_GROUND_EVERY_S: Final = 5.0

#: The least change of the battery's health that is written to the journal.
_HEALTH_STEP: Final = 0.01

#: Faults that the monitors of link and cloud report directly to the gates.
_MONITORED_FAULTS: Final = frozenset({Fault.LINK_LOST, Fault.CLOUD_SILENT})


class Guard:
    """Guards one drone; `faults` are from the last look, the most dangerous first."""

    def __init__(
        self,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        clock: FleetClock,
        *,
        lookout: Lookout,
        events: EventWriter,
        link: LinkMonitor,
        cloud: CloudMonitor,
        heartbeat: Heartbeat,
        on_look: Callable[[Assessment, Situation], None],  # what else each look is for
    ) -> None:
        self._recorder = recorder
        self._clock = clock
        self._on_look = on_look
        self._lookout = lookout
        self._events = events
        self._link = link
        self._cloud = cloud
        self._rescue = Rescue(recorder, vehicle, events)
        self._reserve_soc = vehicle.model.reserve_soc
        self._begins = NewsOrMoment(recorder.watch(), clock)
        self._monitor = FaultMonitor(recorder.logbook.faults)
        self._heartbeat = heartbeat
        self._cleared_at = clock.now()
        self.faults = recorder.logbook.faults

    async def run(self) -> Never:
        """Look for faults for ever."""
        with self._begins:
            while True:
                self.look()
                situation = situation_of(self._recorder.logbook)
                if situation is Situation.FLYING:
                    await self._clock.sleep_until(self._due_at(_FLYING_EVERY_S))
                elif situation in (Situation.STANDING, Situation.DOWN) and not self.faults:
                    await self._begins.wait(until=self._heartbeat.after(self._clock.now()))
                else:
                    # A take-off wakes the guard, and so does every other new record.
                    await self._begins.wait(until=self._due_at(_GROUND_EVERY_S))

    def _due_at(self, fleet_s: float) -> datetime:
        """When the guard must look again, or up to a quarter of the pause earlier."""
        pause = fleet_margin(self._clock, fleet_s=fleet_s, wall_s=_EVERY_WALL_S)
        return at_tick(self._clock.now() + pause, pause / 4)

    def look(self) -> None:
        """Find the current faults, raise alarms, and begin the failsafe that acts."""
        if self._recorder.is_full:
            self._recorder.make_room()
        assessment = self._lookout.look()
        self._keep_health(assessment.state_of_health)
        situation = situation_of(self._recorder.logbook)
        self._on_look(assessment, situation)
        was_grounded = self.takes_off_since is None
        self.faults = self._monitor.update(self._signs(assessment, situation))
        if was_grounded and self.takes_off_since is not None:
            self._cleared_at = assessment.at
            self._recorder.notify_watchers()
        if self.faults or self._recorder.logbook.faults:
            self._raise_alarms(assessment, situation)
            self._act(assessment, situation)

    def _keep_health(self, state_of_health: float) -> None:
        """Write down the battery's health: it takes days to learn and must survive a restart."""
        if abs(state_of_health - self._recorder.logbook.state_of_health) >= _HEALTH_STEP:
            self._recorder.note(HealthLearned(state_of_health=state_of_health))

    def _act(self, assessment: Assessment, situation: Situation) -> None:
        acting = severest(situation, not_ignored(self.faults, self._recorder.logbook))
        if acting is not None:
            self._rescue.begin(*acting, assessment)

    @property
    def begins_since(self) -> datetime | None:
        """The moment since when steps may begin on the ground; None while a failsafe says STAY."""
        return None if Failsafe.STAY in self._on_the_ground() else self._cleared_at

    @property
    def takes_off_since(self) -> datetime | None:
        """The moment since when the drone may take off; None while a failsafe prevents it."""
        is_kept = self._on_the_ground() & {Failsafe.STAY, Failsafe.LAND_AT_NEXT}
        return None if is_kept else self._cleared_at

    def _on_the_ground(self) -> set[Failsafe]:
        """The failsafes of the current faults for a drone that stands."""
        if not self.faults:
            return set()
        faults = set(not_ignored(self.faults, self._recorder.logbook)) - _MONITORED_FAULTS
        return {failsafe_for(Situation.STANDING, fault) for fault in faults}

    def _signs(self, assessment: Assessment, situation: Situation) -> Signs:
        logbook = self._recorder.logbook
        return Signs(
            assessment=assessment,
            situation=situation,
            reserve_soc=self._reserve_soc,
            is_link_lost=self._link.not_lost_since is None,
            is_cloud_silent=self._cloud.is_silent,
            is_disk_full=self._recorder.is_full,
            is_expired=logbook.mission is not None and logbook.mission.has_expired,
        )

    def _raise_alarms(self, assessment: Assessment, situation: Situation) -> None:
        """Raise an alarm for each new fault that matters, and record each fault that ended."""
        logbook = self._recorder.logbook
        for fault in logbook.faults:
            if fault not in self.faults:
                self._recorder.note(FaultEnded(fault=fault))
        for fault in self.faults:
            failsafe, level = failsafe_for(situation, fault), level_of(fault)
            if level is None or failsafe is Failsafe.GO_ON or fault in logbook.faults:
                continue
            alarm = self._events.event("ALARM", assessment.at)
            self._events.write(
                alarm.model_copy(
                    update={
                        "position": assessment.position,
                        "soc": min(1.0, max(0.0, assessment.soc)),
                        "code": fault.value,
                        "level": level,
                        "detail": in_words(fault, failsafe),
                        "data": numbers_behind(fault, assessment, reserve_soc=self._reserve_soc),
                    }
                )
            )


class Rescue:
    """Writes down what a failsafe begins; the pilot then does it."""

    def __init__(self, recorder: FlightRecorder, vehicle: Vehicle, events: EventWriter) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._events = events

    def begin(self, fault: Fault, failsafe: Failsafe, assessment: Assessment) -> None:
        """Begin what the failsafe says, unless that has begun or is not needed."""
        logbook = self._recorder.logbook
        run, mission = run_under_way(logbook), logbook.mission
        if run is None or mission is None:
            return
        match run.step, failsafe:
            case FlyStep() as flight, Failsafe.DIVERT | Failsafe.LAND_NOW:
                escape = mission.escape
                if (
                    escape is None
                    or is_severer(failsafe, escape.failsafe)
                    or (failsafe is Failsafe.DIVERT and _goes_on(escape, flight))
                ):
                    landing = self._landing_for(fault, failsafe, assessment, mission)
                    other = self._other_flight(run, flight, landing, at=assessment.at)
                    self._turn(run, other, fault=fault, failsafe=failsafe)
            case RechargeStep(), Failsafe.WAIT_THEN_ASK:
                if assessment.at - run.started_at >= PAD_WAIT:
                    self._ask(run, fault, assessment)
            case _:
                pass

    def _turn(self, run: StepRun, other: FlyStep, *, fault: Fault, failsafe: Failsafe) -> None:
        at = other.planned_start_at
        soc = self._vehicle.sample(run, at).soc
        used_j = (run.soc - soc) * self._vehicle.model.battery_j
        self._recorder.note(
            FailsafeBegun(
                fault=fault, failsafe=failsafe, at=at, flight=other, soc=soc, used_j=used_j
            )
        )

    def _other_flight(
        self, run: StepRun, flight: FlyStep, landing: Place | None, *, at: datetime
    ) -> FlyStep:
        """The flight from here that replaces the flight under way."""
        here, model = self._vehicle.sample(run, at).position, self._vehicle.model
        if landing is None:
            return descent(instead_of=flight, here=here, at=at, model=model)
        return flight_to(
            landing, instead_of=flight, here=here, at=at, model=model, load_kg=run.load_kg
        )

    def _ask(self, run: StepRun, fault: Fault, assessment: Assessment) -> None:
        """Fail the step where the drone stands, so that the cloud makes another plan."""
        outcome = self._vehicle.cut(run, assessment.at)
        failed = self._events.event("STEP_FAILED", outcome.ended_at, step=run.step)
        self._events.write(
            failed.model_copy(
                update={
                    "started_at": run.started_at,
                    "soc": outcome.soc,
                    "code": fault.value,
                    "detail": in_words(fault, Failsafe.ASK),
                }
            )
        )

    def _landing_for(
        self, fault: Fault, failsafe: Failsafe, assessment: Assessment, mission: CurrentMission
    ) -> Place | None:
        """The landing to fly to; None means on the spot, for LAND_NOW only.

        With a short battery it is the landing with most charge left. For a drone that has left its
        course for the first time it is the end of the flight, if the drone gets there with its
        reserve: the straight way leads back into the corridor. Otherwise it is the nearest safe
        landing, or the landing of the plan if none is safe.
        """
        if failsafe is Failsafe.LAND_NOW:
            return None
        safe, in_reach = assessment.safe_landings, assessment.landings_in_reach
        if in_reach and fault is Fault.BATTERY_SHORT:
            return max(in_reach, key=lambda one: (one.soc_at_landing, one.station_id))
        if fault is Fault.GEOFENCE and mission.escape is None:
            ahead = self._end_in_reach(assessment, mission)
            if ahead is not None:
                return ahead
        if safe:
            return safe[0]
        planned = next(step for step in mission.steps if isinstance(step, FlyStep) and step.lands)
        return Landing(planned.to_id, planned.to_position)

    def _end_in_reach(self, assessment: Assessment, mission: CurrentMission) -> Place | None:
        """The end of the flight under way, if the drone lands there with its reserve."""
        flight = next(step for step in mission.steps if isinstance(step, FlyStep))
        ends = assessment.reach.landings_in_reach(
            [Landing(flight.to_id, flight.to_position)],
            position=assessment.position,
            load_kg=assessment.load_kg,
        )
        least_soc = self._vehicle.model.reserve_soc - SOC_MARGIN
        return next((one for one in ends if one.is_safe and one.soc_at_landing >= least_soc), None)


def _goes_on(escape: Escape, flight: FlyStep) -> bool:
    """Whether a drone that left its course flies on to the end of its flight.

    If it leaves the straight way to that end too, or its battery becomes short, it turns once more.
    """
    return escape.fault is Fault.GEOFENCE and flight.to_id == escape.instead_of.to_id

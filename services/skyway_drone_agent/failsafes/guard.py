"""The guard: looks out for faults while something can go wrong, and has the failsafes act.

What it decides is in the journal first; the pilot then does what the logbook says. So after a
crash in the middle of an escape the drone goes on with it, and does nothing twice.
"""

from datetime import datetime
from typing import Final, Never

from skyway.contracts.drone_health import Failsafe, Fault
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.analysis.lookout import Lookout
from skyway_drone_agent.failsafes.alarms import in_words, level_of, numbers_behind
from skyway_drone_agent.failsafes.failsafe import (
    Situation,
    failsafe_for,
    not_ignored,
    severest,
    situation_of,
)
from skyway_drone_agent.failsafes.faults import FaultMonitor, Signs
from skyway_drone_agent.failsafes.rescue import Rescue
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.logbook import run_under_way
from skyway_drone_agent.journal.records import FaultEnded, HealthLearned
from skyway_drone_agent.journal.waiting import NewsOrMoment
from skyway_drone_agent.link.event_writer import EventWriter
from skyway_drone_agent.link.heartbeat import Heartbeat
from skyway_drone_agent.link.link_monitor import CloudMonitor, LinkMonitor
from skyway_drone_agent.vehicle import Vehicle

#: Between two looks in the air: seconds of fleet time, or of wall time if longer.
_FLYING_EVERY_S, _EVERY_WALL_S = 1.0, 0.25

#: The same on the ground, where nothing falls: while a step is under way, or a fault is there.
_GROUND_EVERY_S: Final = 5.0

#: A change of the battery's health that is worth a line in the journal.
_HEALTH_STEP: Final = 0.01

#: Faults that the watches over link and cloud know of at once: those open the gates themselves.
_MONITORED_FAULTS: Final = frozenset({Fault.LINK_LOST, Fault.CLOUD_SILENT})


class Guard:
    """Watches over one drone; `faults` are those of the last look, the most dangerous first."""

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
    ) -> None:
        self._recorder = recorder
        self._clock = clock
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
        """Look out for ever."""
        with self._begins:
            while True:
                self.look()
                due_at = self._due_at()
                if situation_of(self._recorder.logbook) is Situation.FLYING:
                    await self._clock.sleep_until(due_at)
                else:
                    # A take-off is news, and so is whatever else begins.
                    await self._begins.wait(until=due_at)

    def _due_at(self) -> datetime:
        """Until when the drone may be left alone, unless there is news."""
        logbook, clock, now = self._recorder.logbook, self._clock, self._clock.now()
        if situation_of(logbook) is Situation.FLYING:
            return now + fleet_margin(clock, fleet_s=_FLYING_EVERY_S, wall_s=_EVERY_WALL_S)
        if run_under_way(logbook) is None and not self.faults:
            return self._heartbeat.after(now)
        return now + fleet_margin(clock, fleet_s=_GROUND_EVERY_S, wall_s=_EVERY_WALL_S)

    def look(self) -> None:
        """See what is wrong now, raise alarms, and begin what must be done."""
        if self._recorder.is_full:
            self._recorder.make_room()
        assessment = self._lookout.look()
        self._keep_health(assessment.state_of_health)
        situation = situation_of(self._recorder.logbook)
        was_kept = self.takes_off_since is None
        self.faults = self._monitor.update(self._signs(assessment, situation))
        if was_kept and self.takes_off_since is not None:
            self._cleared_at = assessment.at
            self._recorder.notify_watchers()
        if self.faults or self._recorder.logbook.faults:
            self._raise_alarms(assessment, situation)
            self._act(assessment, situation)

    def _keep_health(self, state_of_health: float) -> None:
        """What takes days to learn must not be forgotten at a restart."""
        if abs(state_of_health - self._recorder.logbook.state_of_health) >= _HEALTH_STEP:
            self._recorder.note(HealthLearned(state_of_health=state_of_health))

    def _act(self, assessment: Assessment, situation: Situation) -> None:
        acting = severest(situation, not_ignored(self.faults, self._recorder.logbook))
        if acting is not None:
            self._rescue.begin(*acting, assessment)

    @property
    def begins_since(self) -> datetime | None:
        """Since when steps may begin on the ground; None while a failsafe says STAY."""
        return None if Failsafe.STAY in self._on_the_ground() else self._cleared_at

    @property
    def takes_off_since(self) -> datetime | None:
        """Since when the drone may take off; None while a failsafe keeps it from that."""
        is_kept = self._on_the_ground() & {Failsafe.STAY, Failsafe.LAND_AT_NEXT}
        return None if is_kept else self._cleared_at

    def _on_the_ground(self) -> set[Failsafe]:
        """What the faults come to once the drone stands, as it may do at any moment."""
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
        """An alarm when a fault begins to matter, a record when one is over."""
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

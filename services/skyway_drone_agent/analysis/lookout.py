"""The lookout: reads the sensors once for all parts that need an assessment."""

from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.analysis.analysis import Analysis, Assessment
from skyway_drone_agent.analysis.landings import NO_LANDINGS, LandingSource
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.logbook import Logbook, doing_now
from skyway_drone_agent.vehicle import Vehicle

#: Looks within this time share a reading: seconds of fleet time, or of wall time if longer.
_MOMENT_FLEET_S, _MOMENT_WALL_S = 0.2, 0.05

#: The newest assessment is fresh for this time: seconds of fleet time, or of wall time if longer.
_FRESH_FLEET_S, _FRESH_WALL_S = 1.0, 0.25

#: Callers do not ask exactly on the tick, so this many times the age still counts as fresh.
_SLACK: Final = 1.5

#: The parts of a logbook that a reading and its analysis use.
_Doing = tuple[object, ...]


class Lookout:
    """Makes the assessments that guard, state and telemetry share."""

    __slots__ = ("_analysis", "_clock", "_doing", "_newest", "_recorder", "_vehicle")

    def __init__(
        self,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        clock: FleetClock,
        *,
        book: LandingSource = NO_LANDINGS,
    ) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        health = recorder.logbook.state_of_health
        self._analysis = Analysis(vehicle.model, state_of_health=health, book=book)
        self._newest: Assessment | None = None
        self._doing: _Doing = ()

    def look(self) -> Assessment:
        """Read the sensors now, unless they were read at this moment."""
        moment = fleet_margin(self._clock, fleet_s=_MOMENT_FLEET_S, wall_s=_MOMENT_WALL_S)
        return self._not_older_than(moment)

    def newest(self) -> Assessment:
        """The last assessment, or a new one if it is old or the drone changed what it does."""
        fresh = fleet_margin(self._clock, fleet_s=_FRESH_FLEET_S, wall_s=_FRESH_WALL_S)
        return self._not_older_than(_SLACK * fresh)

    def consumption_factor(self) -> float:
        """Energy of flights as a multiple of the plan, by the newest assessment."""
        return self.newest().consumption_factor

    def _not_older_than(self, age: timedelta) -> Assessment:
        logbook, now = self._recorder.logbook, self._clock.now()
        newest, doing = self._newest, _doing_of(logbook)
        if newest is not None and abs(now - newest.at) <= age and self._doing == doing:
            return newest
        reading = self._vehicle.read(doing_now(logbook), now)
        self._newest, self._doing = self._analysis.assess(reading, logbook), doing
        return self._newest


def _doing_of(logbook: Logbook) -> _Doing:
    """Without the messages from and to the cloud, which do not change the sensors."""
    standing = (logbook.station_id, logbook.position, logbook.soc, logbook.packages)
    mission = logbook.mission
    if mission is None:
        return standing
    return (
        *standing,
        mission.mission_id,
        mission.steps,
        mission.began_at,
        mission.changed_at,
        mission.escape,
        mission.flown_before,
    )

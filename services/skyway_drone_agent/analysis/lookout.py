"""The lookout: reads the sensors once for all who want to know how the drone is."""

from typing import Final

from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.analysis.analysis import Analysis, Assessment
from skyway_drone_agent.analysis.landings import NO_BOOK, LandingBook
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.under_way import doing_now
from skyway_drone_agent.vehicles.vehicle import Vehicle

#: The newest assessment is good for so many seconds of fleet time, or of wall time if longer.
_FRESH_FLEET_S, _FRESH_WALL_S = 1.0, 0.25

#: A clock's ticks do not fall together with those who ask: so many times as old is still fresh.
_SLACK: Final = 1.5


class Lookout:
    """Guard, state and telemetry see the same assessment."""

    __slots__ = ("_analysis", "_clock", "_newest", "_recorder", "_seen", "_vehicle")

    def __init__(
        self,
        recorder: FlightRecorder,
        vehicle: Vehicle,
        clock: FleetClock,
        *,
        book: LandingBook = NO_BOOK,
    ) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        health = recorder.logbook.state_of_health
        self._analysis = Analysis(vehicle.model, state_of_health=health, book=book)
        self._newest: Assessment | None = None
        self._seen: Logbook | None = None

    def look(self) -> Assessment:
        """Read the sensors now, unless that was done already."""
        logbook, now = self._recorder.logbook, self._clock.now()
        if self._newest is not None and self._newest.at == now and self._seen is logbook:
            return self._newest
        reading = self._vehicle.read(doing_now(logbook), now)
        self._newest, self._seen = self._analysis.take(reading, logbook), logbook
        return self._newest

    def newest(self) -> Assessment:
        """The last assessment, or a new one if it is old or the logbook has changed since."""
        newest = self._newest
        if newest is None or self._seen is not self._recorder.logbook:
            return self.look()
        fresh = fleet_margin(self._clock, fleet_s=_FRESH_FLEET_S, wall_s=_FRESH_WALL_S)
        return self.look() if self._clock.now() - newest.at > _SLACK * fresh else newest

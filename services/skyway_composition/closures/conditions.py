"""All closures of a network, now and later, and its weather, in the form that planning needs."""

import asyncio
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from skyway.contracts.candidate import Candidate
from skyway.ids import NetworkId, StationId
from skyway.network.network import Network
from skyway.planner.airspace import Airspace, SegmentEnds, ZoneReach
from skyway.planner.pad_book import OPEN_MS
from skyway.planner.problem_parts import SegmentClosure, StationClosure
from skyway.runtime.sql.database import Database
from skyway.units import ms_to_moment
from skyway_composition.closures import store
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.network_weather import NetworkWeather
from skyway_composition.closures.store import ForecastKey, forecast_key, forecast_row


# Without slots, because what zones reach is computed on first use and cached.
@dataclass(frozen=True, eq=False)
class Conditions:
    """The closures of a network that are in force or will be, and its weather, if it has any."""

    network: Network
    closures: tuple[Closure, ...]
    weather: NetworkWeather | None = None

    @cached_property
    def has_ground_stops(self) -> bool:
        """Whether a ground stop is in force somewhere, now or later."""
        return any(each.kind == "GROUND_STOP" for each in self.closures)

    def temperature_c(self, at_ms: int) -> float | None:
        """The temperature of the air at a moment, degrees Celsius; None if it is not known."""
        known = self.weather
        return None if known is None else known.forecast.mean_temperature_c(at_ms / 1000)

    def problem_closures(self, start_ms: int) -> tuple[StationClosure | SegmentClosure, ...]:
        """Each station and segment that is closed after a plan's start, by zones too."""
        return tuple(self._problem_closures(start_ms))

    def pad_outages(self, after_ms: int) -> list[tuple[StationId, int, int, int]]:
        """Station, pad, start and end, in ms, of each outage that ends after a moment."""
        return [
            (each.station_id, each.pad, each.from_ms, each.until_ms or OPEN_MS)
            for each in self.closures
            if each.kind == "PAD" and each.lasts_beyond(after_ms)
            if each.station_id is not None and each.pad is not None
        ]

    def ground_stop(
        self, candidate: Candidate, *, at_ms: int, station_ids: Iterable[StationId] = ()
    ) -> str | None:
        """The ground stop, in words, that forbids this drone to take off.

        It may take off neither where it stands nor at one of these stations. None when no ground
        stop that concerns the drone is in force at that moment.
        """
        places = {candidate.station_id, *station_ids}
        for stop in self.closures:
            concerns_drone = (
                stop.kind == "GROUND_STOP"
                and stop.is_in_force(at_ms)
                and stop.provider_id in (None, candidate.provider_id)
                and stop.drone_model_id in (None, candidate.model.model_id)
            )
            if concerns_drone and any(self.is_under(stop, place) for place in places):
                until = (
                    "until it is lifted"
                    if stop.until_ms is None
                    else f"until {ms_to_moment(stop.until_ms).isoformat()}"
                )
                why = "" if stop.reason is None else f": {stop.reason}"
                return f"ground stop {until}{why}"
        return None

    def is_under(self, stop: Closure, station_id: StationId) -> bool:
        """Whether a station lies in the area of a ground stop; without an area all stations do."""
        return stop.area is None or station_id in self._reaches[stop.closure_id].stations

    def reach(self, closure: Closure) -> tuple[tuple[StationId, ...], tuple[SegmentEnds, ...]]:
        """The stations and the segments that a closure closes."""
        if closure.kind == "ZONE":
            reach = self._reaches[closure.closure_id]
            return reach.stations, reach.segments
        station_id, to_id = closure.station_id, closure.to_station_id
        if station_id is None or station_id not in self.network.row_of:
            return (), ()
        if closure.kind == "STATION":
            return (station_id,), ()
        leaving = {segment.to_id for segment in self.network.segments_from(station_id)}
        if closure.kind == "SEGMENT" and to_id is not None and to_id in leaving:
            return (), ((station_id, to_id),)
        return (), ()

    def _problem_closures(self, start_ms: int) -> Iterator[StationClosure | SegmentClosure]:
        for closure in self.closures:
            if not closure.lasts_beyond(start_ms):
                continue
            start_s = (closure.from_ms - start_ms) / 1000
            end_s = None if closure.until_ms is None else (closure.until_ms - start_ms) / 1000
            stations, segments = self.reach(closure)
            # Built without validation: a zone over a city closes thousands of segments.
            for station_id in stations:
                yield StationClosure.model_construct(
                    station_id=station_id, start_s=start_s, end_s=end_s
                )
            for from_id, to_id in segments:
                yield SegmentClosure.model_construct(
                    from_id=from_id, to_id=to_id, start_s=start_s, end_s=end_s
                )

    @cached_property
    def _reaches(self) -> dict[str, ZoneReach]:
        zones = [zone for each in self.closures if (zone := each.zone) is not None]
        reaches = Airspace.over(self.network, zones).reaches
        return {reach.zone.zone_id: reach for reach in reaches}


class CachedConditions:
    """Caches a network's conditions by their number; the current number is read each time.

    `reserve_risk` is the network's setting: the margins in its weather follow from it.
    """

    def __init__(
        self, network_id: NetworkId, network: Network, *, reserve_risk: float | None = None
    ) -> None:
        self._network_id = network_id
        self._reserve_risk = reserve_risk
        self._number = -1
        self._conditions = Conditions(network, ())
        self._forecast_key: ForecastKey | None = None

    async def read(self, db: Database, *, after_ms: int) -> tuple[int, Conditions]:
        """The current number of the conditions, and the closures that end after a moment."""
        async with db.read() as connection:
            number = await store.conditions_number(connection, self._network_id)
        return number, await self.numbered(number, db, after_ms=after_ms)

    async def numbered(self, number: int, db: Database, *, after_ms: int) -> Conditions:
        """The conditions with a number that was just read from the database.

        The conditions may have changed since the number was read. The booking transaction
        notices this, because it compares the numbers.
        """
        if number != self._number:
            await self._renew(number, db, after_ms=after_ms)
        return self._conditions

    async def _renew(self, number: int, db: Database, *, after_ms: int) -> None:
        async with db.read() as connection:
            closures = await store.in_force(connection, self._network_id, after_ms=after_ms)
            key = await forecast_key(connection, self._network_id)
        weather = self._conditions.weather
        if key != self._forecast_key:
            weather = None if key is None else await self._read_weather(db)
        self._number, self._forecast_key = number, key
        self._conditions = Conditions(self._conditions.network, closures, weather)

    async def _read_weather(self, db: Database) -> NetworkWeather | None:
        async with db.read() as connection:
            row = await forecast_row(connection, self._network_id)
        if row is None:
            return None
        # A large forecast is read in some tenths of a second.
        network, reserve_risk = self._conditions.network, self._reserve_risk
        return await asyncio.to_thread(NetworkWeather.read, row, network, reserve_risk=reserve_risk)

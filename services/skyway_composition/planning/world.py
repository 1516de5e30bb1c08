"""The world in which plans are made: a network version, its reservations and its closures.

`ClosedAhead` says whether a landing or a segment is closed at a given time, for any reason.
"""

from collections import defaultdict
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from datetime import datetime
from math import inf
from typing import Self

from skyway.contracts.shortlist import Shortlist
from skyway.contracts.weather import WeatherNote
from skyway.drone.learned_values import UNKNOWN_USE, LearnedValues
from skyway.drone.model import DroneModel
from skyway.ids import DroneModelId, HoldId, MissionId, StationId
from skyway.network.network import Network
from skyway.planner.airspace import ZoneReach
from skyway.planner.energy_risk import EnergyRisk
from skyway.planner.problem_parts import SegmentClosure, StationClosure
from skyway.planner.weather import Weather
from skyway.runtime.sql.database import Database
from skyway.scheduling.trip import BookedPad
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.conditions import Conditions
from skyway_composition.closures.network_weather import NetworkWeather
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.store import Present
from skyway_composition.pads.pad_snapshot import PadSnapshot


@dataclass(frozen=True, slots=True)
class World:
    """The world of a plan; who stores the plan checks with `calendar.commit` that it still holds.

    The database itself checks reservations. In a network with a `reserve_risk` the margins of plans
    depend on `use_deviation`, that of the plan's drone: see `for_drone`.
    """

    skyway: PreparedNetwork
    pads: PadSnapshot
    conditions: Conditions
    conditions_version: int
    use_deviation: float = UNKNOWN_USE

    @property
    def present(self) -> Present:
        """Version and conditions of the network, which must be unchanged when a plan is stored."""
        skyway = self.skyway
        return Present(skyway.network_id, skyway.version, self.conditions_version)

    async def weather(self, model: DroneModel, start_ms: int) -> Weather | None:
        """The weather for a plan of this model from this moment; None if plans assume still air."""
        known = self.conditions.weather
        if known is None:
            return None
        return await known.of_plan(model, start_ms, use_deviation=self.use_deviation)

    @property
    def risk(self) -> EnergyRisk | None:
        """What the energy margin follows from; None if it is a constant of the network."""
        accepted = self.skyway.settings.reserve_risk
        return None if accepted is None else EnergyRisk(accepted, self.use_deviation)

    def for_drone(self, learned: LearnedValues) -> Self:
        """The same world for plans of the drone about which this was learned."""
        if self.risk is None:
            return self
        deviation = learned.still_air_deviation
        if self.conditions.weather is not None:
            deviation = self.conditions.weather.planned_deviation(deviation)
        return replace(self, use_deviation=deviation)

    def energy_margin(self, model: DroneModel) -> float:
        """The share of energy that plans of this model add to all flights.

        With a `reserve_risk` and a forecast the weather adds what the error of its wind needs.
        """
        risk = self.risk
        if risk is None:
            return self.skyway.settings.energy_margin
        is_forecast = self.conditions.weather is not None
        return risk.own_margin if is_forecast else risk.climate_margin(model)

    def energy_margins(self, shortlist: Shortlist) -> dict[Hashable, float]:
        """The energy margin of each kind of drone; empty if all have the network's."""
        if self.risk is None:
            return {}
        learned = dict(zip(shortlist.kinds, shortlist.each_learned, strict=True))
        return {
            kind: self.for_drone(learned[kind]).energy_margin(model)
            for kind, model in shortlist.planned_model_of.items()
            if kind in learned
        }

    def least_time_factors(
        self, models: Mapping[DroneModelId, DroneModel]
    ) -> dict[DroneModelId, float]:
        """By model: a lower bound of the time factors of its flights; empty in still air."""
        known = self.conditions.weather
        if known is None:
            return {}
        return {model_id: known.least_time_factor(model) for model_id, model in models.items()}

    def weather_note(self, at_ms: int) -> WeatherNote | None:
        """The forecast that a plan from this moment uses; None if plans assume still air."""
        known = self.conditions.weather
        return None if known is None else known.note_at(at_ms)

    def in_still_air(self) -> Self:
        """The same world without weather."""
        return replace(self, conditions=replace(self.conditions, weather=None))

    def without(self, owners: Collection[MissionId | HoldId]) -> Self:
        """The same world, in which the pads of these missions and holds count as free."""
        return replace(self, pads=self.pads.without(owners))

    def anew(self) -> Self:
        """The same world, in which pads are read again."""
        return replace(self, pads=self.pads.anew())

    def instead(self, pads: Mapping[MissionId, Collection[BookedPad]]) -> Self:
        """The same world, in which these missions have reserved exactly these pads."""
        return replace(self, pads=self.pads.instead(pads))

    @classmethod
    async def at(
        cls,
        present: Present,
        networks: PreparedNetworks,
        *,
        db: Database,
        after_ms: int,
        pad_gap_s: float | None = None,
    ) -> Self:
        """The world of a network at a version and conditions number that were just read.

        Reservations begin `pad_gap_s` early; None means the network's own gap.

        Raises
        ------
        Misdirected
            Another composition serves the network.
        """
        networks.own.refuse_foreign(present.network_id)
        skyway = await networks.version(present.network_id, present.version)
        number = present.conditions
        conditions = await skyway.conditions.numbered(number, db, after_ms=after_ms)
        pads = _pads(skyway, db, conditions, after_ms=after_ms, pad_gap_s=pad_gap_s)
        return cls(skyway, pads, conditions, number)

    @classmethod
    async def of(
        cls,
        skyway: PreparedNetwork,
        db: Database,
        *,
        after_ms: int,
        supposed: Sequence[Closure] = (),
    ) -> Self:
        """The network with the closures and reservations that end after a moment.

        The `supposed` closures were not made: a dry run plans as if they were.
        """
        number, conditions = await skyway.conditions.read(db, after_ms=after_ms)
        if supposed:
            conditions = replace(conditions, closures=(*conditions.closures, *supposed))
        return cls(skyway, _pads(skyway, db, conditions, after_ms=after_ms), conditions, number)


def _pads(
    skyway: PreparedNetwork,
    db: Database,
    conditions: Conditions,
    *,
    after_ms: int,
    pad_gap_s: float | None = None,
) -> PadSnapshot:
    gap_s = skyway.settings.pad_gap_s if pad_gap_s is None else pad_gap_s
    return PadSnapshot(
        db,
        skyway.network_id,
        skyway.network,
        after_ms=after_ms,
        outages=conditions.pad_outages(after_ms),
        gap_ms=round(gap_s * 1000),
    )


#: From one moment until before another, milliseconds since 1970.
_Span = tuple[float, float]


class ClosedAhead:
    """The closures and zones of a network from a moment on; with a drone model its weather too."""

    def __init__(self, network: Network, known: NetworkWeather | None = None) -> None:
        self._network = network
        self._known = known
        self._use_deviation = UNKNOWN_USE
        self._weather: Weather | None = None
        self._stations: dict[StationId, list[_Span]] = defaultdict(list)
        self._segments: dict[tuple[StationId, StationId], list[_Span]] = defaultdict(list)

    @classmethod
    def of(cls, world: World, *, now_ms: int) -> Self:
        """All that is closed in a world, now or later; after its end a forecast closes nothing."""
        known = world.conditions.weather
        is_over = known is None or now_ms >= known.over_ms
        closed = cls(world.skyway.network, None if is_over else known)
        closed._use_deviation = world.use_deviation
        closed.add(world.conditions.problem_closures(now_ms), start_ms=now_ms)
        closed.add_zones(world.skyway.airspace.reaches)
        return closed

    def for_model(self, model: DroneModel) -> Self:
        """The same, with the segments that the weather closes for drones of this model."""
        if self._known is None:
            return self
        closed = copy(self)
        closed._weather = self._known.of_model(model, self._use_deviation)
        return closed

    def add(self, closures: Iterable[StationClosure | SegmentClosure], *, start_ms: int) -> None:
        """Add closures whose seconds count from this moment."""
        for closure in closures:
            end_ms = inf if closure.end_s is None else start_ms + closure.end_s * 1000
            span = start_ms + closure.start_s * 1000, end_ms
            if isinstance(closure, StationClosure):
                self._stations[closure.station_id].append(span)
            else:
                self._segments[closure.from_id, closure.to_id].append(span)

    def add_zones(self, reaches: Iterable[ZoneReach]) -> None:
        """Add the zones of the network."""
        for reach in reaches:
            span = _ms(reach.zone.active_from, -inf), _ms(reach.zone.active_until, inf)
            for station_id in reach.stations:
                self._stations[station_id].append(span)
            for ends in reach.segments:
                self._segments[ends].append(span)

    def closes_landing(self, station_id: StationId, at_ms: float) -> bool:
        """Whether the station is closed at that moment, or no longer exists.

        Opening hours do not count: a drone that comes late lands, and waits on the ground.
        """
        if station_id not in self._network.stations:
            return True
        spans = self._stations.get(station_id, ())
        return any(start_ms <= at_ms < end_ms for start_ms, end_ms in spans)

    def is_shut(self, station_id: StationId, at_ms: float) -> bool:
        """Whether the station is closed by its opening hours at that moment."""
        hours = self._network.opening_hours.get(station_id)
        return hours is not None and not hours.is_open(ms_to_moment(int(at_ms)))

    def closes_segment(
        self, from_id: StationId, to_id: StationId, *, start_ms: float, end_ms: float
    ) -> bool:
        """Whether the segment is closed at some moment of that time, or no longer exists."""
        if from_id not in self._network.stations or not any(
            each.to_id == to_id for each in self._network.segments_from(from_id)
        ):
            return True
        weather = self._weather
        if weather is not None and weather.closes(
            from_id, to_id, start_s=start_ms / 1000, end_s=end_ms / 1000
        ):
            return True
        spans = self._segments.get((from_id, to_id), ())
        return any(from_ms < end_ms and start_ms < until_ms for from_ms, until_ms in spans)

    def is_closed_for_good(self, station_id: StationId) -> bool:
        """Whether a station is closed without an end, or no longer exists."""
        spans = self._stations.get(station_id, ())
        exists = station_id in self._network.stations
        return not exists or any(end_ms == inf for _, end_ms in spans)


def _ms(moment: datetime | None, unknown: float) -> float:
    return unknown if moment is None else moment_to_ms(moment)
